"""Everything that prevents a calibration is reported at once, before anything moves."""

import re
from pathlib import Path
from typing import Any, Self

import pytest

from drivers.simulated.cell import SimulatedCell
from tests.drivers.simulated.encoders import faults
from tests.hexacell.services.notify.local_servers import closed_port

COMMANDS = ["preflight", "run"]

pytestmark = pytest.mark.usefixtures("few_candidates")


@pytest.fixture
def cell_folder(short_cell: Any) -> Any:
    """A short cell: its failures are those of a cell with many points."""
    return short_cell


@pytest.fixture
def served(served_cell: Path, cell_folder: Any) -> Any:
    """A folder whose cell file reaches a served cell; tests break it."""
    config = f'config = "{cell_folder.controller.name}"'
    text = re.sub(r"(?m)^config = .*$", config, served_cell.read_text())
    cell_folder.cell.write_text(text.replace("timeout_s = 20.0", "timeout_s = 3.0"))
    return cell_folder


def port_of(served: Any, gauge: str) -> str:
    match = re.search(rf'name = "{gauge}"[^\[]*?port = "([^"]*)"', served.cell.read_text())
    assert match
    return match[1]


def refused(typed: Any, served: Any, command: str, code: int, *words: str) -> str:
    """Assert that a command ends with a code and prints these words, and leaves the folder unchanged."""
    before = served.snapshot()
    outcome = typed(command, served.cell, "--json")
    assert outcome.code == outcome.document["exit_code"] == code, outcome.err
    for word in words:
        assert word in outcome.err
        assert word in outcome.document["error"]
    assert served.snapshot() == before
    return str(outcome.err)


@pytest.mark.usefixtures("never_moves", "one_robot")
def test_a_cell_without_faults(typed_here, cell_folder):
    before = cell_folder.snapshot()
    outcome = typed_here("preflight", cell_folder.cell, "--json")
    assert outcome.code == 0, outcome.err
    lines = outcome.err.splitlines()
    ready = [line for line in lines if line.startswith("ok  ")]
    assert len(ready) == 3 + 6 + 1 + 1
    assert "nothing was moved" in ready[-1]
    assert max(map(len, lines)) <= 80
    assert cell_folder.snapshot() == before
    assert outcome.document["ready"] is True
    devices = outcome.document["devices"]
    protocols = [*("sylvac", "mux10", "cdi"), *["cia406"] * 6, "linuxcncrsh"]
    assert [device["protocol"] for device in devices] == protocols
    assert [device["name"] for device in devices[:3]] == ["x", "y", "z"]


def notes_of_refusal(cell_folder) -> set[str]:
    """What runs without a person leave that did not begin: why, each in a folder of its own."""
    return {str((run / "not-begun.json").relative_to(cell_folder.path)) for run in cell_folder.runs()}


@pytest.mark.usefixtures("never_moves")
def test_gauges_carried_by_hand_need_a_person(typed_here, cell_folder):
    cell_folder.edit(('placement = "fixed"', 'placement = "by-hand"'))
    before = cell_folder.snapshot()
    for arguments in (["preflight", "--unattended"], ["run", "--unattended"], ["run"]):
        outcome = typed_here(*arguments, cell_folder.cell, "--json")
        assert outcome.code == outcome.document["exit_code"] == 4
        assert 'placement = "fixed"' in outcome.err
        left = {name: content for name, content in cell_folder.snapshot().items() if name not in before}
        assert {name for name, content in left.items() if content is not None} <= notes_of_refusal(
            cell_folder
        )
        assert cell_folder.snapshot().items() >= before.items()


def test_two_gauges_with_their_cables_swapped(typed_here, served):
    x, z = port_of(served, "x"), port_of(served, "z")
    served.edit((x, "#"), (z, x), ("#", z))
    refused(typed_here, served, "preflight", 3, "gauge x", "gauge z", "port")


@pytest.mark.parametrize("command", COMMANDS)
def test_several_failures_are_reported_at_once(typed_here, served, command):
    nobody = closed_port()
    served.edit(
        (port_of(served, "x"), "/dev/nowhere"),
        ("nodes = [1, 2, 3, 4, 5, 6]", "nodes = [9, 2, 3, 4, 5, 6]"),
        ("[100.0, 100.0, 550.0],", "[100.0, 100.0, 1550.0],"),
    )
    text = served.cell.read_text()
    served.cell.write_text(re.sub(r"(?m)^port = \d+$", f"port = {nobody}", text))
    words = ("gauge x", "leg 1", f"controller 127.0.0.1:{nobody}", "verification point 3")
    message = refused(typed_here, served, command, 3, *words)
    assert message.count("\n  - ") >= len(words)
    advice = "`hexacell devices` shows what is connected" in " ".join(message.split())
    assert advice == (command == "preflight")


@pytest.mark.usefixtures("never_moves")
@pytest.mark.parametrize(
    ("command", "fault", "words"),
    [
        ("run", lambda cell: faults.add_duplicate(cell.encoders, 3), ("leg 3", "node 3")),
        ("preflight", lambda cell: faults.set_alarms(cell.encoders, 3), ("leg 3",)),
    ],
    ids=["duplicated", "alarm"],
)
def test_an_encoder_that_is_not_as_it_should_be(
    typed_here, cell_folder, monkeypatch, command, fault, words
):
    class Faulty(SimulatedCell):
        def __enter__(self) -> Self:
            fault(self)
            return super().__enter__()

    monkeypatch.setattr("drivers.simulated.cell.SimulatedCell", Faulty)
    refused(typed_here, cell_folder, command, 3, *words)


def test_an_unknown_plugin_is_reported_with_the_nearest(typed_here, cell_folder):
    text = cell_folder.cell.read_text()
    for old, new, words, nearest in (
        ('protocol = "sylvac"', 'protocol = "sylvak"', "gauge protocol 'sylvak'", "'sylvac'?"),
        ('protocol = "cia406"', 'protocol = "cia408"', "encoder protocol 'cia408'", "'cia406'?"),
        ('= "linuxcncrsh"', '= "linuxcncrs"', "controller protocol 'linuxcncrs'", "'linuxcncrsh'?"),
        ('config_format = "toml"', 'config_format = "tom"', "config format 'tom'", "'toml'?"),
        ('mechanism = "hexaglide"', 'mechanism = "hexaglid"', "'hexaglid'", "'hexaglide'?"),
    ):
        cell_folder.cell.write_text(text.replace(old, new))
        commands = ["preflight"], ["run"], ["simulate"], ["cell", "validate"]
        for command in commands if "sylvak" in new else commands[:1]:
            outcome = typed_here(*command, cell_folder.cell)
            assert outcome.code == 2
            assert all(word in outcome.err for word in ("Did you mean", words, nearest))
