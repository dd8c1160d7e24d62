"""A simulated cell serves a calibration in another process, and ends without leftovers."""

import re
import signal
import tomllib
from pathlib import Path

import pytest

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
