"""Each bundled mechanism does the whole job on the wire, in words of its own."""

import json
import re

import pytest

from hexacell.cell.loader import load_cell
from hexacell.robot.model import robot_of
from procedures.steps import events
from tests.cli.commands import run_command
from tests.cli.conftest import Demo

NOT_THEIRS = re.compile(r".*\b(?:slider|rail|hexaglide)\w*.*", re.IGNORECASE)
FREE = {"gough-stewart": 33, "linapod": 45, "rotary-cranks": 57, "five-legs": 31, "four-arms": 23}


@pytest.fixture(scope="module", params=FREE)
def demo(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Demo:
    folder = tmp_path_factory.mktemp(request.param)
    outcome = run_command(folder, "demo", "--config", request.param, "--json")
    return Demo(outcome, folder / "hexacell-demo", request.param)


pytestmark = pytest.mark.slow


def test_it_passes_and_falls_by_more_than_95_percent(demo: Demo) -> None:
    assert demo.outcome.code == 0, demo.outcome.err
    line = demo.outcome.document["line"]
    match = re.fullmatch(
        r"(\d+) parameters, \d+ records at [5-8] points; mean deviation at held-out poses "
        r"(\d+\.\d+) -> (\d+\.\d+) mm; "
        r"position error at the task poses (0\.\d{3}) \+- (0\.\d{3}) mm \(limit 0\.3\): pass",
        line,
    )
    assert match, line
    free, before, after, error, expanded = (float(number) for number in match.groups())
    assert free == FREE[demo.name]
    assert after < 0.05 * before
    assert error + expanded < 0.2


def test_no_record_leaves_the_travel(demo: Demo) -> None:
    history = demo.events()
    assert not [event for event in history if isinstance(event, events.RecordRejected)]
    taken = [event for event in history if isinstance(event, events.RecordTaken)]
    assert max(abs(mm) for event in taken for mm in event.deviation_mm) < 5.0


def test_the_controller_has_the_identified_geometry(demo: Demo) -> None:
    """In other frames: both give the same parameters in the convention's."""
    robot, result = robot_of(load_cell(demo.cell)), json.loads((demo.run / "result.json").read_text())
    written, _ = robot.mechanism.normalize_frames(robot.controller)
    found = robot.mechanism.parameters.vector(result["geometry"])
    assert written.vector == pytest.approx(found, abs=1e-5)


def test_nothing_is_said_in_words_of_another_mechanism(demo: Demo, typed_here) -> None:
    if load_cell(demo.cell).settings.mechanism.words.guide is not None:
        pytest.skip("its joints are sliders on rails")
    assert typed_here("report", demo.run).code == 0
    fitted = typed_here("fit", demo.cell, "--measurements", demo.run / "measurements.csv")
    texts = {
        "demo": demo.outcome.err,
        "fit": fitted.out + fitted.err,
        **{name: (demo.run / name).read_text() for name in ("report.html", "result.json", "cell.toml")},
    }
    unit = load_cell(demo.cell).settings.mechanism.words.joint_unit
    assert f"encoder_{unit}" in json.loads(texts["result.json"])["noise"]
    for name, text in texts.items():
        assert not NOT_THEIRS.findall(text), name


def test_a_check_of_it_passes(demo: Demo, typed) -> None:
    checked = typed("run", demo.cell, "--unattended", "--mode", "check", "--json")
    assert checked.code == 0, checked.err
    assert checked.document["verdict"] == "pass"
