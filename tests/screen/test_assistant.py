"""The first-time assistant: from questions to a valid cell file, with every mistake named at once."""

import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

from drivers.discovery.gauges import FoundGauge, PortFindings
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.errors import FileError, HexacellError
from hexacell.screen.app import TechnicianApp
from hexacell.screen.further_screens import AssistantScreen
from hexacell.screen.model import ScreenModel
from hexacell.services.devices.device_search import SearchFindings, draft_of
from hexacell.services.devices.first_cell import CELLS, CellDraft
from hexacell.text.screens.first_questions import FirstCellAssistant
from tests.screen.test_history_screen import WithoutDevices
from tests.screen.test_job import press, shown, until_shown
from tests.waiting import until

CONFIG = "simulated-hexaglide.controller.toml"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    shutil.copy(bundled_config("simulated-hexaglide").with_name(CONFIG), tmp_path / "robot-geometry.toml")
    return tmp_path / "cell.toml"


@asynccontextmanager
async def opened_assistant(path: Path) -> AsyncIterator[Pilot[int]]:
    app = TechnicianApp(lambda: ScreenModel(WithoutDevices(load_cell(path))), first_cell=path)
    async with app.run_test(size=(80, 24)) as pilot:
        await until(lambda: isinstance(app.screen, AssistantScreen))
        await until(lambda: "Question 1 of" in shown(pilot))
        yield pilot


def is_other(pilot: Pilot[int], before: str) -> bool:
    """Whether something else is shown than before."""
    return shown(pilot) != before


async def test_the_questions_lead_to_a_valid_cell_file(path: Path) -> None:
    async with opened_assistant(path) as pilot:
        await press(pilot, "enter")
        assert pilot.app.screen.query_one(Input).value == "robot-geometry.toml"  # found beside it
        pilot.app.screen.query_one(Input).value = "nowhere.toml"
        await pilot.press("enter")
        await until_shown(pilot, "nowhere.toml: cannot be read: it does not exist. Check the path")
        pilot.app.screen.query_one(Input).value = "robot-geometry.toml"
        await pilot.press("enter")
        await until_shown(pilot, "Question 3 of")
        await press(pilot, "escape")
        assert "Question 2 of" in shown(pilot)
        app = pilot.app
        assert isinstance(app, TechnicianApp)
        for _ in range(len(CellDraft(path).answers()) - 1):
            before = shown(pilot)
            await pilot.press("enter")
            await until(partial(is_other, pilot, before))
        await until_shown(pilot, "robot       hexaglide")
    cell = load_cell(path)
    assert cell.settings.name == "cell"
    assert cell.config_path.name == "robot-geometry.toml"
    assert [gauge.port for gauge in cell.settings.gauges] == [
        "/dev/ttyUSB0",
        "/dev/ttyUSB1",
        "/dev/ttyUSB2",
    ]


@pytest.mark.parametrize("cell", CELLS)
def test_what_is_proposed_is_a_cell_of_the_mechanism_of_the_config(tmp_path, cell) -> None:
    config = bundled_config(cell).with_name(f"{cell}.controller.toml")
    shutil.copy(config, tmp_path)
    assistant = FirstCellAssistant(tmp_path / "new.toml")
    while not assistant.is_done:
        assistant.answer(assistant.suggestion)
        assert assistant.problem == ""
    settings, bundled = load_cell(tmp_path / "new.toml").settings, load_cell(bundled_config(cell)).settings
    assert settings.robot == bundled.robot
    assert settings.limits == bundled.limits


def test_a_wrong_answer_is_refused_with_its_reason(path: Path) -> None:
    draft = CellDraft(path)
    for name, given, problem in (
        ("name", "\udcff", "it has characters that cannot be shown"),
        ("name", "a\x1b[A", "it has characters that cannot be shown"),
        ("name", "", "must be text that is not empty"),
        ("tolerance", "x", "'x' is no number"),
        ("tolerance", "-1", "must be more than 0"),
        ("port", "99999999", "must be 65535 or less"),
        ("port", "1.5", "'1.5' is no whole number"),
        ("joints", "5", "2 numbers are expected: the smallest and the largest position"),
        ("joints", "800 -800", "joint_m"),
        ("gauges.x.protocol", "foo", "it is one of cdi, digimatic-usb, heidenhain-nd"),
        ("gauges.y.sign", "perhaps", "answer yes or no"),
        ("nodes", "1 1 2 3 4 5", "two encoders have the same node id"),
        ("bus", "can0", "name the interface and the channel"),
        ("points", "1 2", "4 numbers are expected"),
    ):
        assert problem in draft.problem(name, given)


@pytest.mark.parametrize("protocol", ["mitutoyo-id-h", "uwave"])
def test_a_gauge_that_is_found_is_taken(path: Path, protocol: str) -> None:
    found = FoundGauge(protocol, "/dev/ttyUSB7", "one", channel=3, shown="+1.2345", baudrate=19200)
    findings = SearchFindings((), (PortFindings(found.port, (found,)),), (), None)
    draft = draft_of(findings, path)
    assert draft.problem("gauges.x.protocol", draft.given["gauges.x.protocol"]) == ""
    draft.write()
    gauge = load_cell(path).settings.gauges[0]
    assert (gauge.protocol, gauge.port, gauge.channel) == (protocol, "/dev/ttyUSB7", 3)
    assert (gauge.serial, gauge.resolution_mm) == ({"baudrate": 19200}, 0.0001)


def test_a_file_that_came_meanwhile_is_not_written_over(path: Path) -> None:
    draft = CellDraft(path)
    path.write_text("of somebody else")
    with pytest.raises(FileError, match="is there already"):
        draft.write()
    assert path.read_text() == "of somebody else"


def test_points_out_of_reach_leave_no_file_and_a_sign_is_asked_in_words(path: Path) -> None:
    draft = CellDraft(path, {"points": "0 0 5500 200"})
    with pytest.raises(HexacellError, match="stated poses are out of reach"):
        draft.write()
    assert not path.exists()
    draft = CellDraft(path, {"gauges.z.sign": "no"})
    draft.write()
    assert [gauge.sign for gauge in load_cell(path).settings.gauges] == [1, 1, -1]
