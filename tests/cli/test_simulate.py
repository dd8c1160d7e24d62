"""Cells served to other processes, simulated or results by OPC UA, until interrupted, without leftovers."""

import re
import signal
import sys
import tomllib
from pathlib import Path

import pytest

from tests.hexacell.services.notify.local_servers import closed_port

CELL = "simulated-hexaglide.toml"
CONTROLLER = "simulated-hexaglide.controller.toml"


def serving(start, folder):
    """A cell that is being served, and the cell file that it printed."""
    process = start("simulate", folder.cell)
    process.wait_for("serving", lambda: process.err)
    return process, process.out


def test_simulate_prints_a_complete_cell_file_without_the_true_geometry(served_cell, typed_here):
    text = served_cell.read_text()
    settings = tomllib.loads(text)
    assert "simulation" not in settings
    assert all(gauge["port"] for gauge in settings["gauges"])
    assert settings["encoders"]["bus"]["interface"] == "slcan"
    assert settings["controller"]["host"] == "127.0.0.1"
    assert Path(settings["controller"]["config"]) == served_cell.parent / CONTROLLER
    assert typed_here("cell", "validate", served_cell).code == 0
    truth = tomllib.loads(served_cell.with_name(CELL).read_text())["simulation"]["geometry"]
    assert not any(str(length) in text for length in truth["l"])


def test_a_signal_ends_simulate_without_leftovers(start, cell_folder, typed_here):
    with cell_folder.cell.open("a") as file:
        file.write('\n[[simulation.faults]]\nkind = "in inches"\ndevice = "x"\n')
    (cell_folder.path / "taught.toml").write_bytes(cell_folder.controller.read_bytes())
    cell_folder.edit(('# taught = "robot-taught.toml"', 'taught = "taught.toml"'))
    process, text = serving(start, cell_folder)
    served = cell_folder.path.parent / "served.toml"
    served.write_text(text)
    assert tomllib.loads(text)["controller"]["taught"] == str((cell_folder.path / "taught.toml").resolve())
    watched = typed_here("devices", "--diagnose", "x", "--cell", served, "--seconds", "0.1")
    assert (watched.code, "gauge x: answers in inch" in watched.err) == (3, True)
    before = cell_folder.snapshot()
    assert list(process.temporary.iterdir())
    outcome = process.stopped(signal.SIGTERM)
    assert outcome.code == 0
    assert outcome.err == "serving; Ctrl-C ends it\n"
    assert outcome.out == text
    assert cell_folder.snapshot() == before
    for port in re.findall(r'(?:port|channel) = "([^"]+)"', text):
        # A pseudo-terminal's own number is given to whoever asks next.
        assert port.startswith("/dev/pts/") or not Path(port).exists()


@pytest.mark.slow
def test_simulate_ends_while_a_run_is_connected(quick_cell, start):
    """The run then reports which device is lost, and that it can be resumed."""
    simulation, text = serving(start, quick_cell)
    printed = quick_cell.path / "served.toml"
    printed.write_text(text)
    run = start("run", printed, "--mode", "check")
    run.wait_until(lambda: "journal" in names_below(printed.parent), "a journal")
    assert simulation.stopped(signal.SIGTERM).code == 0
    stopped = run.ended()
    assert stopped.code == 3
    assert re.search(r"^(hexacell: )?(gauge|encoder|controller|gauges) ", stopped.err, re.MULTILINE)
    if "controller" in stopped.err:
        assert stopped.err.startswith("PRESS THE EMERGENCY STOP"), "it is gone, and cannot stop the robot"
    assert f"--resume {printed.parent / 'runs'}" in stopped.out


def names_below(folder: Path) -> set[str]:
    return {path.stem for path in folder.rglob("*")}


def test_the_files_of_the_cell_itself_are_not_written_over(cell_folder, typed_here):
    before = cell_folder.cell.read_bytes()
    outcome = typed_here("simulate", cell_folder.cell, "--output", cell_folder.cell)
    assert (outcome.code, cell_folder.cell.read_bytes()) == (2, before)
    assert "is left as it is. Name a new file" in " ".join(outcome.err.split())


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM])
def test_it_serves_until_it_is_interrupted(start, cell_folder, number) -> None:
    port = closed_port()
    with cell_folder.cell.open("a") as cell:
        cell.write(f"\n[opcua]\nport = {port}\nanonymous = true\n")
    process = start("serve", cell_folder.cell)
    process.wait_for("serving", lambda: process.err)
    assert f"serving opc.tcp://127.0.0.1:{port}/hexacell/" in process.err
    assert "warning: anybody who reaches the server" in process.err
    process.popen.send_signal(number)
    assert process.popen.wait() == 0


def test_it_is_off_until_the_cell_file_says_otherwise(typed_here, cell_folder) -> None:
    outcome = typed_here("serve", cell_folder.cell)
    assert (outcome.code, "[opcua]" in outcome.err) == (2, True)


def test_without_asyncua_it_says_what_to_install(typed_here, cell_folder, monkeypatch) -> None:
    with cell_folder.cell.open("a") as cell:
        cell.write("\n[opcua]\nanonymous = true\n")
    for module in [name for name in sys.modules if name.startswith("hexacell.result_server")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "asyncua", None)
    outcome = typed_here("serve", cell_folder.cell)
    assert (outcome.code, "hexacell[opcua]" in outcome.err) == (2, True)


def test_who_serves_others_is_warned_and_needs_a_reader(typed_here, cell_folder) -> None:
    with cell_folder.cell.open("a") as cell:
        cell.write('\n[opcua]\nhost = "0.0.0.0"\n')
    outcome = typed_here("serve", cell_folder.cell)
    assert (outcome.code, "nobody may read the results" in outcome.err) == (2, True)
    assert "warning: who reaches 0.0.0.0:4840" in outcome.err
