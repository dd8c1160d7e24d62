"""Sections of the cell file with rules of their own: what they give, each mistake with its line."""

from datetime import date
from typing import get_args

import pytest

from hexacell.cell.loader import describe, load_cell
from hexacell.cell.recovery import Action, AttendedRecovery, FailureKind, UnattendedRecovery
from hexacell.cell.uncertainty import SIZES_OF_GRADES, Grade, RotaryUncertaintySettings, UncertaintySettings
from hexacell.errors import FileError
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.robot.model import robot_of
from hexacell.robot.stated import noise_of


@pytest.fixture
def load_due(load_changed):
    """A cell with a certificate of gauge x that holds until a day, and a machine named for reports."""
    gauge = 'name = "x"\naxis = "x"\n'
    report = '[report]\nmachine = "Hexaglide HX 3"\nserial_number = "0017"\n'

    def load(due: str):
        certificate = f'serial_number = "4711"\ncertificate = {{number = "D-K 17", due = {due}}}\n'
        return load_changed((gauge, gauge + certificate), ("[simulation]", f"{report}[simulation]"))

    return load


def test_a_certificate_holds_until_the_day_that_is_stated(load_due) -> None:
    settings = load_due('"2027-03-31"').settings
    assert settings.certificates["gauge x"].number == "D-K 17"
    assert settings.expired_on(date(2027, 3, 31)) == ()
    assert settings.expired_on(date(2027, 4, 1)) == ("gauge x",)
    assert (settings.report.machine, settings.report.serial_number) == ("Hexaglide HX 3", "0017")


@pytest.mark.parametrize("due", ['"2027-02-30"', '"soon"', '""', '"31.3.2027"', "20270331", "true"])
def test_what_is_no_day_is_refused_with_its_line(load_due, due) -> None:
    with pytest.raises(FileError, match="day") as refusal:
        load_due(due)
    assert refusal.value.line is not None


@pytest.fixture
def cell_with(copied):
    """A Gough-Stewart platform's cell with these lines in [identification]."""
    return lambda lines: copied("gough-stewart", ("[identification]\n", f"[identification]\n{lines}\n"))


@pytest.mark.parametrize(
    ("lines", "choice"),
    [
        ('identify = "zeros"', ParameterChoice.ZEROS),
        ("", ParameterChoice.ALL),
        ('identify = "all"', ParameterChoice.ALL),
        ('identify = ["zeros"]', ParameterChoice.ZEROS),
    ],
)
def test_the_robot_knows_what_is_identified(cell_with, tmp_path, lines, choice) -> None:
    cell = load_cell(cell_with(lines))
    assert robot_of(cell).identifies is choice
    (tmp_path / "again.toml").write_text(describe(cell))
    assert load_cell(tmp_path / "again.toml").settings == cell.settings


@pytest.mark.parametrize("lines", ['identify = ["rails"]', "identify = []", 'identify = ["zeros", "all"]'])
def test_another_choice_is_refused_with_its_line(cell_with, lines: str) -> None:
    with pytest.raises(FileError) as refused:
        load_cell(cell_with(lines))
    assert "identify" in str(refused.value)


def test_a_provisional_geometry_has_all_parameters(cell_with) -> None:
    lines = 'identify = ["zeros"]\nprovisional = true'
    with pytest.raises(FileError, match="a provisional geometry has all parameters"):
        load_cell(cell_with(lines))


STATED = "encoder_mm = 0.01\ngauge_mm = 0.01\n"


def test_one_figure_is_that_of_all_instruments_or_each_has_its_own(load_changed) -> None:
    noise = noise_of(load_changed((STATED, "encoder_mm = 0.02\ngauge_mm = 0.005\n")).settings)
    assert noise.encoders.tolist() == [0.02] * 6
    assert noise.gauges_mm.tolist() == [0.005] * 3
    own = "gauges_mm = [0.01, 0.03, 0.01]\nencoder_mm = 0.02\n"
    noise = noise_of(load_changed((STATED, own)).settings)
    assert noise.gauges_mm.tolist() == pytest.approx([0.01, 0.03, 0.01])
    assert noise.encoders.tolist() == pytest.approx([0.02] * 6)


def test_a_cell_states_its_own_escalations(load_with) -> None:
    cell = load_with('[recovery]\nagreement_mm = 0.02\n[recovery.unattended]\ndrift = ["abort"]\n')
    recovery = cell.settings.recovery
    assert recovery.agreement_mm == 0.02
    assert recovery.unattended.action(FailureKind.DRIFT, 1) is Action.ABORT
    assert recovery.unattended.action(FailureKind.ZERO_VOID, 1) is Action.REDO_SET


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[recovery.unattended]\ndrift = ["redo-set"]\n', "drift must end with ask or abort"),
        ('[recovery.unattended]\ndrift = ["ask"]\n', "drift asks, but the run is unattended"),
        ("[recovery.attended]\ndrift = []\n", "drift must end with ask or abort"),
        ('[recovery.attended]\ndrift = ["pray"]\n', "retry"),
        ('[recovery.attended]\ndrifft = ["ask"]\n', "drift"),
    ],
)
def test_invalid_escalations_are_refused(load_with, text: str, words: str) -> None:
    with pytest.raises(FileError, match=words):
        load_with(text)


@pytest.mark.parametrize("escalations", [AttendedRecovery(), UnattendedRecovery()])
def test_there_is_an_escalation_for_every_kind_but_the_final_ones(escalations: AttendedRecovery) -> None:
    named = set(type(escalations).model_fields)
    assert named == {kind.value for kind in FailureKind} - {FailureKind.FINAL.value}
    assert escalations.action(FailureKind.FINAL, 1) is Action.ABORT


ROOM = '\n[[thermometers]]\nname = "room"\npath = "/sys/class/hwmon/hwmon0/temp1_input"\n'


def test_settings_of_a_thermometer(load_text, cell_text) -> None:
    rails = ROOM.replace("room", "rails") + 'protocol = "laser"\ntimeout_s = 0.5\n'
    cell = load_text(cell_text + ROOM + rails)
    room, other = cell.settings.thermometers
    assert (room.name, room.protocol, room.timeout_s) == ("room", "sysfs", 2.0)
    assert (other.name, other.protocol, other.timeout_s) == ("rails", "laser", 0.5)
    assert load_text(describe(cell)).settings == cell.settings


SECTION = '[uncertainty]\ngrade = "ideal"\n'
SIZES = set(UncertaintySettings.model_fields) - {"grade", "sources", "stop_repeatability_acts"}


@pytest.fixture
def load_section(load_changed):
    return lambda lines: load_changed((SECTION, lines))


def test_a_cell_without_the_section_is_no_ideal_machine(load_section) -> None:
    stated = load_section("").settings.uncertainty
    assert stated.grade == "precision"
    assert stated.encoder_scale_um_m == 10.0
    assert stated.load_n == 20.0


@pytest.mark.parametrize("grade", get_args(Grade))
def test_every_grade_is_told_and_only_states_sizes_that_exist(load_section, grade: Grade) -> None:
    assert set(SIZES_OF_GRADES[grade]) <= SIZES | set(RotaryUncertaintySettings.model_fields)
    cell = load_section(f'[uncertainty]\ngrade = "{grade}"\n')
    stated = cell.settings.uncertainty
    sizes = {key: size for key, size in SIZES_OF_GRADES[grade].items() if key in SIZES}
    assert {key: getattr(stated, key) for key in sizes} == sizes


def test_a_size_replaces_that_of_the_grade_and_has_its_source(load_section) -> None:
    stated = load_section(
        '[uncertainty]\ngrade = "ordinary"\nload_n = 50\nrail_wave_long_um = 4.0\n'
        'sources = {rail_wave_long_um = "certificate 7"}\n'
    ).settings.uncertainty
    assert (stated.load_n, stated.rail_wave_long_um, stated.rail_wave_short_um) == (50.0, 4.0, 5.0)
    sources = [stated.source(key) for key in ("load_n", "rail_wave_long_um", "rail_wave_short_um")]
    assert sources == ["cell file", "certificate 7", "assumed: ordinary"]


MISTAKES = {
    STATED: [
        (f"{STATED}standstill_readings = 5\n", "5 standstill_readings are no series"),
        (f"{STATED}standstill_readings = -1\n", "0 or more"),
        (f"{STATED}averaged_windows = 0\n", "1 or more"),
        (f'{STATED}figures = "guessed"\n', "'stated' or 'measured'"),
        (f"{STATED}gauges_mm = [0.01, 0.0, 0.01]\n", "more than 0"),
        (f"{STATED}encoders_mm = [0.01]\n", "6"),
    ],
    SECTION: [
        ('[uncertainty]\ngrade = "superb"\n', "'precision', 'ordinary' or 'ideal'"),
        ("[uncertainty]\ngrade = 3\n", "'precision', 'ordinary' or 'ideal'"),
        ("[uncertainty]\nload_n = -1.0\n", "0 or more"),
        ("[uncertainty]\nrail_wave_long_mm = 0.0\n", "more than 0"),
        ('[uncertainty]\nsources = {load = "drawing"}\n', "sources has load, which is no size"),
        ("[uncertainty]\nweight_n = 3.0\n", "unknown key"),
    ],
    "": [
        (ROOM + ROOM, "two thermometers have the same name"),
        (ROOM.replace("path", "file"), "'path'"),
        (ROOM.replace("room", ""), "text that is not empty"),
        (ROOM + "legs = [7]\n", "legs"),
        (ROOM + "legs = [4, 4]\n", "two thermometers are on the same leg"),
        (ROOM + "legs = [4]\n" + ROOM.replace("room", "other") + "legs = [4]\n", "on the same leg"),
    ],
}


@pytest.mark.parametrize(("old", "more"), [(old, one) for old in MISTAKES for one in MISTAKES[old]])
def test_mistakes_are_named_with_their_line(refusal, cell_text, old: str, more: tuple[str, str]) -> None:
    """Some in the line of the section's head."""
    new, words = more
    text = cell_text.replace(old, new, 1) if old else cell_text + new
    begin = cell_text.rindex("\n[", 0, cell_text.index(old) + 2) if old else len(cell_text)
    refusal(text, words, cell_text[: begin + 1].count("\n") + 1)
