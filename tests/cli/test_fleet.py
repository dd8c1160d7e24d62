"""All cells that share a PostgreSQL, seen from one computer; a real server is started."""

import socket
from datetime import UTC, datetime, timedelta

from hexacell.cli.commands.status import fleet_text
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.history.cell_status import FleetCell


def share(cell, url: str, name: str) -> None:
    text = cell.read_text().replace('name = "simulated-hexaglide"', f'name = "{name}"', 1)
    cell.write_text(f'{text}\n[archive]\nurl = "{url}"\n')


def test_two_cells_on_two_computers(typed_here, postgresql, demo, calibrated, cell_folder, monkeypatch):
    text = calibrated.read_text().replace("[acceptance]\n", "[acceptance]\nvalid_days = 30\n", 1)
    calibrated.write_text(text)
    share(calibrated, postgresql, "cell A")
    (calibrated.parent / "runs" / "simulated-hexaglide").rename(calibrated.parent / "runs" / "cell A")
    share(cell_folder.cell, postgresql, "cell B")
    assert "No cell has put" in typed_here("status", "--archive", postgresql).out
    for host, cell in (("east", calibrated), ("west", cell_folder.cell)):
        monkeypatch.setattr(socket, "gethostname", lambda host=host: host)
        assert typed_here("status", cell).code == 0
    monkeypatch.setattr(socket, "gethostname", lambda: "office")

    outcome = typed_here("status", "--archive", postgresql, "--json")
    assert outcome.code == 0, outcome.err
    first, second = outcome.document["cells"]
    accuracy = demo.outcome.document["verification"]["accuracy"]["position"]
    assert (first["name"], first["host"], first["verdict"]) == ("cell A", "east", "pass")
    assert (first["position_mm"], first["expanded_mm"]) == (accuracy["value"], accuracy["expanded"])
    assert (first["latest_run"], first["mode"]) == (demo.run.name, "optimise")
    ended = datetime.fromisoformat(first["latest_at"])
    assert datetime.fromisoformat(first["due_at"]) == ended + timedelta(days=30)
    assert (second["name"], second["host"]) == ("cell B", "west")
    assert second["latest_run"] is second["verdict"] is None
    lines = outcome.err.splitlines()
    assert lines[1].split()[:3] == ["cell", "A", "east"]
    assert lines[2] == f"  calibration due on {ended + timedelta(days=30):%Y-%m-%d}"
    assert max(map(len, lines)) <= 80

    history = typed_here("history", "--archive", postgresql, "--json")
    (run,) = history.document["runs"]
    assert (run["cell"], run["host"]) == ("cell A", "east")
    assert (run["run"], run["verdict"]) == (demo.run.name, "pass")
    assert "cell A" in history.err


def test_a_run_puts_its_cell_there(typed_here, postgresql, quick_cell) -> None:
    share(quick_cell.cell, postgresql, "cell C")
    with cell_lock(quick_cell.controller):
        assert typed_here("run", quick_cell.cell, "--unattended").code == 5
    cells = typed_here("status", "--archive", postgresql, "--json").document["cells"]
    assert ("cell C", str(quick_cell.cell)) in {(one["name"], one["cell"]) for one in cells}


def test_an_absent_archive_is_an_error_and_stops_no_run(typed_here, tmp_path, quick_cell) -> None:
    nowhere = f"postgresql://nobody@/none?host={tmp_path}"
    for command in ("status", "history"):
        outcome = typed_here(command, "--archive", nowhere)
        assert (outcome.code, "cannot be read" in outcome.err) == (2, True)
    share(quick_cell.cell, nowhere, "cell D")
    outcome = typed_here("status", quick_cell.cell)
    assert outcome.code == 0
    assert len(outcome.err.splitlines()) == 1
    with cell_lock(quick_cell.controller):
        outcome = typed_here("run", quick_cell.cell, "--unattended")
    assert outcome.code == 5
    assert "warning" in outcome.err


def test_what_needs_a_cell_says_so(typed_here) -> None:
    archive = ("--archive", "postgresql://me@host/cells")
    for arguments in (
        ("status",),
        ("history",),
        ("history", "--drift", *archive),
        ("status", "--metrics", "x.prom", *archive),
        ("status", "cell.toml", *archive),
    ):
        outcome = typed_here(*arguments)
        assert (outcome.code, "cell" in outcome.err) == (2, True)


def test_what_is_overdue_is_said() -> None:
    now = datetime.now(UTC)
    late = FleetCell(name="late", host="east", cell="x", seen_at=now, due_at=now - timedelta(days=1))
    fine = FleetCell(name="fine", host="east", cell="x", seen_at=now, due_at=now + timedelta(days=1))
    assert (late.is_overdue, fine.is_overdue) == (True, False)
    text = fleet_text([late, fine])
    assert (text.count("OVERDUE"), text.count("due on")) == (1, 1)
