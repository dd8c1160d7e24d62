"""``hexacell cell``, and what every command reports about files it cannot use."""

import json
import tomllib

import pytest

from hexacell.cell.by_mechanism import cell_model
from hexacell.cell.model import CellSettings


def test_a_good_cell_is_valid_and_nothing_is_changed(typed_here, cell_folder):
    before = cell_folder.snapshot()
    outcome = typed_here("cell", "validate", cell_folder.cell)
    assert (outcome.code, outcome.err) == (0, "")
    assert f"{cell_folder.cell}" in outcome.out
    assert f"{cell_folder.controller}" in outcome.out
    told = typed_here("cell", "validate", cell_folder.cell, "--json")
    assert (told.code, told.document) == (0, {"valid": True, "name": "simulated-hexaglide"})
    assert "valid" in told.err
    assert cell_folder.snapshot() == before


def test_schema_describes_the_bundled_cells(typed_here):
    pretty, compact = typed_here("cell", "schema"), typed_here("cell", "schema", "--json")
    assert (pretty.code, pretty.err) == (compact.code, compact.err) == (0, "")
    assert compact.out.count("\n") == 1
    assert json.loads(pretty.out) == compact.document
    assert set(compact.document["properties"]) == set(CellSettings.model_fields)
    assert set(compact.document["required"]) < set(compact.document["properties"])


def test_show_is_a_cell_file_with_defaults_and_origins(typed_here, cell_folder):
    outcome = typed_here("cell", "show", cell_folder.cell)
    assert (outcome.code, outcome.err) == (0, "")
    assert "homing_timeout_s = 60.0  # default\n" in outcome.out
    number, name = next(
        (number, line.partition("#")[0].strip())
        for number, line in enumerate(cell_folder.cell.read_text().splitlines(), 1)
        if line.startswith("gauge_travel_mm")
    )
    assert f"{name}  # line {number}\n" in outcome.out
    shown = tomllib.loads(outcome.out)
    model, stated = (
        cell_model("hexaglide", encoder_scales=False),
        tomllib.loads(cell_folder.cell.read_text()),
    )
    assert model.model_validate_json(json.dumps(shown)) == model.model_validate_json(json.dumps(stated))


def line_of(text: str, words: str) -> int:
    return text[: text.index(words)].count("\n") + 1


MISTAKES = {
    "unknown key": ("cell", ("tilt_deg = 45.0", "tild_deg = 45.0"), "tild_deg", "Did you mean 'tilt_deg'?"),
    "no TOML": ("cell", ("tilt_deg = 45.0", "tilt_deg = = 45.0"), "tilt_deg", "not valid TOML"),
    "a leg of no length": (
        "controller",
        ("  590.0,  # leg 1", "  0.0,  # leg 1"),
        "  0.0,  # leg 1",
        "'l' in [geometry], number 1 is 0.0, but must be more than 0",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_cell_file_or_the_config_is_named_with_its_line(typed_here, cell_folder, mistake):
    file, (old, new), place, words = MISTAKES[mistake]
    path = getattr(cell_folder, file)
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    before = cell_folder.snapshot()
    for command in (["cell", "validate"], ["run"]):
        outcome = typed_here(*command, cell_folder.cell, "--json")
        assert outcome.code == outcome.document["exit_code"] == 2
        assert f"{path}:{line_of(path.read_text(), place)}: " in outcome.err
        assert words in outcome.err
        assert cell_folder.snapshot() == before


ON_THE_ROBOT = (["cell", "validate"], ["run"], ["preflight"], ["simulate"])


def test_files_that_are_not_there(typed_here, cell_folder):
    cell_folder.controller.unlink()
    before = cell_folder.snapshot()
    for command in ON_THE_ROBOT:
        outcome = typed_here(*command, cell_folder.cell)
        assert outcome.code == 2
        assert f"{cell_folder.controller}: cannot be read: it does not exist" in outcome.err
    for command in (*ON_THE_ROBOT, ["cell", "show"], ["fit", "--measurements", "x"]):
        outcome = typed_here(*command, "absent.toml")
        assert (outcome.code, outcome.out) == (2, "")
        assert outcome.err == "hexacell: absent.toml: cannot be read: it does not exist. Check the path\n"
    assert cell_folder.snapshot() == before


def test_a_real_cell_cannot_be_simulated(typed_here, cell_folder):
    cell_folder.without_simulation()
    cell_folder.edit(("[controller]", "[controller]\nport = 1"))
    outcome = typed_here("simulate", cell_folder.cell)
    assert (outcome.code, outcome.out) == (2, "")
    assert f"{cell_folder.cell}: there is no [simulation] in it" in outcome.err


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("[100.0, 100.0, 550.0]", "[0.0, 0.0, 5500.0]", "5500.0", "verification point 3: leg 1"),
        ("poses = [", "poses = [[0.0, 0.0, 550.0, 60.0, 0.0, 0.0],", "60.0, 0.0, 0.0]", "task pose 1: "),
        (
            "[0.0, -155.0, 0.0]",
            "[0.0, -1e6, 0.0]",
            "[robot.nominal]",
            "the drawing is not of the robot in ",
        ),
    ],
)
def test_a_pose_or_a_drawing_of_another_robot_is_refused_with_its_line(
    typed_here, cell_folder, old, new, place, words
):
    text = cell_folder.cell.read_text()
    assert old in text
    cell_folder.cell.write_text(text.replace(old, new, 1))
    line = line_of(cell_folder.cell.read_text(), place)
    outcome = typed_here("cell", "validate", cell_folder.cell)
    assert outcome.code == 2
    assert f"{cell_folder.cell}:{line}: {words}" in outcome.err


def test_files_of_ten_thousands_of_mistakes_are_refused_in_few_lines(typed_here, cell_folder):
    text = cell_folder.cell.read_text()
    cell_folder.cell.write_text("".join(f"a{n} = 1\n" for n in range(30_000)) + text)
    outcome = typed_here("cell", "validate", cell_folder.cell)
    assert outcome.code == 2
    assert "has many mistakes; among them:" in outcome.err
    assert len(outcome.err.splitlines()) == 21
    cell_folder.cell.write_text(f"{text}\n{'.'.join('a' * 100_000)} = 1\n")
    outcome = typed_here("cell", "validate", cell_folder.cell)
    assert outcome.code == 2
    assert "a key has too many parts. Shorten it" in outcome.err


def test_an_expired_certificate_is_warned_about(typed_here, cell_folder) -> None:
    gauge, text = 'name = "x"\naxis = "x"\n', cell_folder.cell.read_text()
    for due, is_told in (("2020-01-01", True), ("9999-12-31", False)):
        certified = f'{gauge}certificate = {{ number = "D-K 17", due = "{due}" }}\n'
        cell_folder.cell.write_text(text.replace(gauge, certified))
        outcome = typed_here("cell", "validate", cell_folder.cell)
        warning = f"the certificate of gauge x expired on {due}: a person must approve"
        assert (outcome.code, warning in outcome.err) == (0, is_told)
