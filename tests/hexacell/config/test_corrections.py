"""Corrections in configs: read with the line of every mistake, written beside what the owner has."""

import re
import tempfile
from dataclasses import fields, replace
from os.path import commonprefix
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.loader import load_cell
from hexacell.config.change import ConfigChange, propose
from hexacell.config.interface import ConfigPart
from hexacell.config.layout import ConfigLayout, FormatOfFile, fingerprint
from hexacell.config.linuxcnc_hal import HalPins
from hexacell.config.linuxcnc_ini import LinuxcncIni
from hexacell.config.toml_format import NativeToml
from hexacell.config.write_back import commit, rollback
from hexacell.errors import FileError
from hexacell.kinematics.corrections import NO_CORRECTIONS, CorrectionKind, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.storage.toml_document import TomlDocument
from hexacell.text.config_changes import correction_lines
from tests.cli.cell_folder import CONFIGS
from tests.hexacell.config.conftest import CONFIG
from tests.native_config import NATIVE
from tests.several_config_files import LAYOUT, ZEROS, drawn_geometry, ini_text, write_config

EVERY = frozenset(CorrectionKind)
SOME = Corrections(
    backlash=(0.0, 0.0, 0.102, 0.0, -0.004, 0.0),
    play_mm=(0.02, 0.02, 0.02, 0.02, 0.02, 0.03),
    compliance_um_n=(0.3, 0.31, 0.3, 0.3, 0.0, 0.3),
    weight_n=100.0,
)
LAGGING = Corrections(backlash=SOME.backlash)

sizes = st.sampled_from([0.0, -0.0031, 0.102, 4.99999])
drawn = st.builds(
    Corrections,
    st.tuples(*[sizes] * 6),
    st.tuples(*[sizes] * 6),
    st.tuples(*[sizes.map(abs)] * 6),
    st.sampled_from([0.0, 98.1]),
    st.sampled_from([(0.0, 0.0, -1.0), (0.6, 0.0, -0.8)]),
    st.sampled_from([None, (0.0, 1.5, -80.25)]),
)

WHOLE = """
[corrections] # of the owner
backlash = [0, +1e-1, 0.0, # 2.0
  0, 0, 0] # of the screws
play_mm = [0,0,0,0,0,0]
compliance_um_n = [ 0.25, 0, 0, 0, 0, 0 ]
weight_direction = [0, 0, -9.81]
weight_n = 5 # N
weight_centre_mm = [] # joints

[after]
play_mm = 7 # of others
"""
WITHOUT = {
    "no table": ("", ""),
    "no end": ("", "# the end"),
    "empty": ("", "[ corrections ] # mine\n[after]\nbacklash = 1\n"),
    "a key": ("", "[corrections]\nweight_n = 98.1 # N\n[after]\nbacklash = 1\n"),
    "a key at the end": ("", "[corrections]\nweight_n = 98.1"),
    "dotted": ("corrections.weight_n = 98.1 # N\n", ""),
    "inline": ("corrections = { weight_n = 98.1 } # N\n", ""),
    "empty inline": ("corrections = {}\n", ""),
}


def read(layout: ConfigLayout, *texts: str) -> Corrections:
    with tempfile.TemporaryDirectory() as place:
        paths = [Path(place) / f"config-{number}" for number, _ in enumerate(texts)]
        for path, text in zip(paths, texts, strict=True):
            path.write_bytes(text.encode())
        return layout.read(*paths).corrections


def assert_same(found: Corrections, wanted: Corrections) -> None:
    for one in fields(Corrections):
        if (value := getattr(wanted, one.name)) is None:
            assert getattr(found, one.name) is None
        else:
            assert getattr(found, one.name) == pytest.approx(value, abs=1e-6), one.name


def geometry_in(text: str) -> Geometry:
    [reader] = NATIVE.formats
    values = reader.reader.read(text, None).values
    return Geometry(NATIVE.parameters, [values[name] for name in NATIVE.parameters.names])


@given(drawn, drawn, st.sampled_from(["\n", "\r\n"]))
def test_numbers_that_are_there_change_in_their_places_alone(one, other, end) -> None:
    text = (CONFIG + WHOLE).replace("\n", end)
    geometry, there = geometry_in(text), read(NATIVE, text)
    assert NATIVE.rewrite([text], geometry) == NATIVE.rewrite([text], geometry, there) == (text,)
    for wanted in (one, other):
        [new] = NATIVE.rewrite([text], geometry, wanted)
        assert_same(read(NATIVE, new), wanted)
        assert NATIVE.rewrite([new], geometry, wanted) == (new,)
        # Without the numbers, and the brackets of those that are there at once, nothing else differs.
        assert re.sub(r"[-+.\deE\[\], ]", "", new) == re.sub(r"[-+.\deE\[\], ]", "", text)
        text = new


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(("top", "bottom"), WITHOUT.values(), ids=WITHOUT)
def test_what_is_absent_is_put_into_the_table_and_that_at_the_end(top: str, bottom: str, end: str) -> None:
    text = (top + CONFIG + bottom).replace("\n", end)
    geometry = geometry_in(text)
    assert NATIVE.rewrite([text], geometry, read(NATIVE, text)) == (text,)
    wanted = replace(SOME, weight_n=98.1, weight_centre_mm=(1.0, 2.0, 3.0))
    [new] = NATIVE.rewrite([text], geometry, wanted)
    assert_same(read(NATIVE, new), wanted)
    first = commonprefix([text, new])  # noqa: RUF071 - of characters
    assert new.endswith(text[len(first) :])
    assert new.count("\n") == new.count(end)
    if "corrections" not in text:
        assert "# What the controller adds for what is not geometry" in new[len(first) :]


def test_corrections_of_zero_write_nothing_where_there_is_no_table() -> None:
    assert NATIVE.rewrite([CONFIG], geometry_in(CONFIG), NO_CORRECTIONS) == (CONFIG,)


@pytest.mark.parametrize(
    ("table", "line", "words"),
    [
        ("corrections = 3", 1, "must be a section"),
        ("[[corrections]]", 1, "must be a section"),
        ("[corrections]\nplay = [1]", 2, r"unknown key 'play' in \[corrections\]"),
        ("[corrections]\n\nbacklash = [0, 0]", 3, "a list of 6 items"),
        ("[corrections]\nplay_mm = [0, 0,\n 5.5, 0, 0, 0]", 3, "number 3 is 5.5, but must be"),
        ("[corrections]\nbacklash = [0, 0, nan, 0, 0, 0]", 2, "number 3 is nan"),
        ("[corrections]\ncompliance_um_n = [0, 0, 0, -0.1, 0, 0]", 2, "number 4 is -0.1, but must"),
        ("[corrections]\ncompliance_um_n = [0, 0, 0, 101, 0, 0]", 2, "100 or less"),
        ("[corrections]\nweight_n = true", 2, "is true"),
        ("[corrections]\nweight_n = -1", 2, "is -1"),
        ("[corrections]\nweight_direction = [0, 0, 0]", 2, "is no direction"),
        ("[corrections]\nweight_direction = []", 2, "a list of 3 items"),
        ("[corrections]\nweight_centre_mm = [1]", 2, "a list of 3 items"),
    ],
)  # fmt: skip
def test_every_mistake_is_named_with_its_line(tmp_path: Path, table: str, line: int, words: str) -> None:
    path = tmp_path / "config.toml"
    path.write_text(
        f"{table}\n{CONFIG}" if "=" in table.split("\n", maxsplit=1)[0] else f"{CONFIG}{table}\n"
    )
    with pytest.raises(FileError, match=words) as caught:
        NATIVE.read(path)
    assert caught.value.line == line + (0 if path.read_text().startswith(table) else CONFIG.count("\n"))
    assert caught.value.subject == str(path)


def test_corrections_that_read_back_differently_are_never_written(monkeypatch: pytest.MonkeyPatch) -> None:
    geometry, replaced = geometry_in(CONFIG + WHOLE), TomlDocument.replaced
    monkeypatch.setattr(TomlDocument, "replaced", lambda *args: replaced(*args).replace("0.102", "0.12"))
    with pytest.raises(FileError, match="reads back with another backlash"):
        NATIVE.rewrite([CONFIG + WHOLE], geometry, SOME)


def test_a_change_names_what_it_adds_and_is_undone_bit_for_bit(config: Path, geometry: Geometry) -> None:
    start, before = fingerprint(config), config.read_bytes()
    kept = propose((config,), NATIVE, geometry, fingerprint_at_start=start)
    assert kept.changed_corrections == ()
    change = propose((config,), NATIVE, geometry, SOME, fingerprint_at_start=start)
    change.save(config.with_name("proposal.json"))
    change = ConfigChange.load(config.with_name("proposal.json"))
    lines = correction_lines(change.changed_corrections)
    assert lines[:2] == ("backlash of joint 3: 0 -> 0.102 mm", "backlash of joint 5: 0 -> -0.004 mm")
    assert lines[-2:] == ("compliance of leg 6: 0 -> 0.3 um/N", "weight: 0 -> 100 N")
    assert "+backlash = [0.0, 0.0, 0.102, 0.0, -0.004, 0.0]" in change.diff
    receipt = commit(change, config.parent / "run")
    assert NATIVE.read(config).corrections == SOME
    again = propose((config,), NATIVE, geometry, fingerprint_at_start=fingerprint(config))
    assert (again.text_after, again.corrections_after) == (again.text_before, SOME)
    rollback(receipt)
    assert config.read_bytes() == before


def linuxcnc(name: str) -> tuple[ConfigLayout, tuple[Path, ...]]:
    cell = load_cell(CONFIGS / name / "cell.toml")
    return ConfigLayout.of(cell.settings), cell.config_paths


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_linuxcnc_gets_backlash_as_the_last_variable_of_each_joint(tmp_path: Path, end: str) -> None:
    layout, paths = linuxcnc("linuxcnc-hexapod")
    texts = [path.read_text().replace("\n", end) for path in paths]
    geometry = layout.read(*paths).geometry
    assert layout.read(*paths).holds == {CorrectionKind.BACKLASH}
    assert layout.rewrite(texts, geometry, NO_CORRECTIONS) == tuple(texts)
    new = layout.rewrite(texts, geometry, LAGGING)
    assert read(layout, *new) == LAGGING
    added = "HOME_SEQUENCE = 0" + end + "BACKLASH = {}" + end
    expected = "".join(texts)
    for joint, value in ((2, "0.102"), (4, "-0.004")):
        place = expected.index("HOME_SEQUENCE = 0", expected.index(f"[JOINT_{joint}]"))
        line = f"HOME_SEQUENCE = 0{end}"
        expected = expected[:place] + added.format(value) + expected[place + len(line) :]
    assert "".join(new) == expected
    other = layout.rewrite(new, geometry, replace(LAGGING, backlash=(0.0, 0.0, 0.2, 0.0, 0.0, 0.0)))
    assert "".join(other) == expected.replace("0.102", "0.2").replace("-0.004", "0.0")
    with pytest.raises(FileError, match="no place for corrections of play"):
        layout.rewrite(texts, geometry, SOME)


def test_what_linuxcnc_would_not_use_is_no_place_for_backlash() -> None:
    layout, paths = linuxcnc("linuxcnc-hexaglide")
    found = layout.read(*paths)
    assert found.holds == {CorrectionKind.PLAY, CorrectionKind.COMPLIANCE}, (
        "an included file without joints"
    )
    with pytest.raises(FileError, match=r"no place for corrections of backlash.*further_files"):
        layout.rewrite([path.read_text() for path in paths], found.geometry, LAGGING)


LEGS_INI = LinuxcncIni(HEXAGLIDE_PARAMETERS, {"section": "KINS", "unit_mm": 25.4}, is_part=True)
LEGS_HAL = HalPins(HEXAGLIDE_PARAMETERS, {"component": "kins"}, is_part=True)
INI_TEXT = "".join(["[KINS]\n", *(f"{key} = 0.001\n" for key in LEGS_INI._pins)])
HAL_TEXT = "".join(f"setp {key} 0.001\n" for key in LEGS_HAL._pins)


@given(drawn, drawn, st.sampled_from([(LEGS_INI, INI_TEXT, 25.4), (LEGS_HAL, HAL_TEXT, 1.0)]))
def test_a_component_that_reads_them_gets_play_and_compliance(one, other, case) -> None:
    form, text, unit_mm = case
    there = form.read(text, None).corrections
    assert (there.play_mm[0], there.compliance_um_n[5]) == pytest.approx((0.001 * unit_mm, unit_mm))
    assert (there.weight_n, there.weight_centre_mm) == (0.001, None)
    assert form.rewrite(text, {}, there) == form.rewrite(text, {}) == text
    for wanted in (replace(each, backlash=NO_CORRECTIONS.backlash) for each in (one, other)):
        new = form.rewrite(text, {}, wanted)
        assert_same(form.read(new, None).corrections, wanted)
        assert form.rewrite(new, {}, wanted) == new
        assert re.sub(r" [-.\d]+\n", "", new) == re.sub(r" [-.\d]+\n", "", text)
        text = new


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("PLAY1 = 0.001", "PLAY1 = 0.2", "PLAY1 is 0.2"),
        ("COMPLIANCE6 = 0.001", "COMPLIANCE6 = -1e-4", "COMPLIANCE6 is -1e-4"),
        ("PLAY3 = 0.001\n", "", "there is no PLAY3"),
        ("0.001", "0.0", "the weight has no direction"),
    ],
)
def test_what_the_component_must_not_get_is_refused(old: str, new: str, problem: str) -> None:
    with pytest.raises(FileError, match=problem):
        LEGS_INI.read(INI_TEXT.replace(old, new), None)


INI = LinuxcncIni(GOUGH_STEWART_PARAMETERS, ZEROS | {"unit_mm": 25.4}, is_part=True)


@pytest.mark.parametrize(
    ("joint", "added", "problem", "backlash"),
    [
        ("[JOINT_1]", "BACKLASH = 0.01", "", 0.254),
        ("[JOINT_1]", "TYPE = ANGULAR\r\nBACKLASH = 0.01", "", 0.01),
        ("[JOINT_1]", "COMP_FILE = screw.comp\r\nBACKLASH = 0.01", "", 0.0),
        ("[JOINT_1]", "BACKLASH = 0.5", "more than a machine can have", 0.0),
        ("[JOINT_1]", "BACKLASH = 1\r\nBACKLASH = 1", "a second time", 0.0),
        ("[JOINT_1]", "BACKLASH = 1 # mm", "a part of the value", 0.0),
        ("[JOINT_1]", "NOTE = a\\\nBACKLASH = 1", "ends with a backslash", 0.0),
    ],
)
def test_backlash_as_linuxcnc_takes_it(joint: str, added: str, problem: str, backlash: float) -> None:
    text = ini_text(drawn_geometry()).replace(joint, f"{joint}\r\n{added}")
    if problem:
        with pytest.raises(FileError, match=problem) as caught:
            INI.read(text, None)
        assert caught.value.line is not None
        return
    found = INI.read(text, None)
    assert found.corrections.backlash == pytest.approx((0.0, backlash, 0.0, 0.0, 0.0, 0.0))
    assert found.holds == (frozenset() if "COMP_FILE" in added else {CorrectionKind.BACKLASH})
    if found.holds:
        wanted = replace(LAGGING, backlash=(0.0, 0.03, 0.102, 0.0, -0.004, 0.0))
        new = INI.rewrite(text, found.values, wanted)
        assert INI.read(new, None).corrections.backlash == pytest.approx(wanted.backlash, abs=1e-6)


def test_backlash_in_two_files_is_refused(tmp_path: Path) -> None:
    ini = FormatOfFile("linuxcnc-ini", LinuxcncIni(GOUGH_STEWART_PARAMETERS, ZEROS, is_part=True))
    hal, _ = LAYOUT.formats
    layout = ConfigLayout(GOUGH_STEWART_PARAMETERS, (hal, ini, FormatOfFile("linuxcnc-ini", ini.reader)))
    first, second = write_config(tmp_path)
    text = "".join(f"[JOINT_{joint}]\nBACKLASH = 0.1\n" for joint in range(6))
    second.write_text(second.read_text().replace("MIN_LIMIT", "BACKLASH = 0.1\nMIN_LIMIT", 1))
    third = tmp_path / "third.ini"
    third.write_text(text)
    with pytest.raises(FileError, match=r"backlash is in hexapod\.ini and in third\.ini"):
        layout.read(first, second, third)


def test_a_plug_in_that_knows_of_no_corrections_holds_none(config: Path) -> None:
    class PlugIn(NativeToml):
        def read(self, text: str, source: Path | None) -> ConfigPart:
            return replace(super().read(text, source), corrections=NO_CORRECTIONS, holds=frozenset())

    layout = ConfigLayout(NATIVE.parameters, (FormatOfFile("plug-in", PlugIn(NATIVE.parameters, {})),))
    found = layout.read(config)
    assert found.holds == frozenset()
    assert found.corrections == NO_CORRECTIONS
    [text] = layout.rewrite([CONFIG], found.geometry, NO_CORRECTIONS)
    assert text == CONFIG
    with pytest.raises(FileError, match="no place for corrections of backlash"):
        layout.rewrite([CONFIG], found.geometry, LAGGING)
