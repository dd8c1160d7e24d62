"""``--mode quick`` as it is typed: refused without a result, and from one calibration to the next check."""

from pathlib import Path

import pytest

pytestmark = pytest.mark.usefixtures("few_candidates")


@pytest.fixture
def cell_folder(quick_cell):
    """Measured quickly, with few records for the quick level."""
    quick_cell.cell.write_text(f"{quick_cell.cell.read_text()}\n[quick]\nbudget_records = 20\n")
    return quick_cell


def test_without_a_result_it_says_what_to_do(typed_here, cell_folder) -> None:
    for command in ("run", "preflight"):
        outcome = typed_here(command, cell_folder.cell, "--mode", "quick")
        assert outcome.code == 2
        assert "no accepted result has this config: the quick level carries on from one" in outcome.err
        assert "hexacell run CELL --mode optimise" in " ".join(outcome.err.split())
    assert cell_folder.runs() == []


@pytest.mark.slow
def test_from_a_calibration_on(typed_here, cell_folder) -> None:
    """What is told before, at the end, in the history, in the report, and to programs."""
    assert typed_here("run", cell_folder.cell, "--unattended", "--mode", "optimise").code == 0
    before = typed_here("preflight", cell_folder.cell, "--mode", "quick", "--json").document["expected"]
    assert 12 <= before["quick"]["records"] <= 20
    shown = typed_here("preflight", cell_folder.cell, "--mode", "quick")
    assert "and then the held-out poses as after a calibration" in " ".join(shown.out.split())

    done = typed_here("run", cell_folder.cell, "--unattended", "--mode", "quick", "--json")
    assert done.code == 0, done.err
    assert "the quick level starts from the result of" in done.err
    assert "that the last calibration left" in " ".join(done.err.split())
    assert "written to the controller" in done.err
    told = done.document["quick"]
    assert told["records"] <= 20
    assert [one["records"] for one in told["further"]] == [12, 24, 48]

    latest, first = typed_here("history", cell_folder.cell, "--json").document["runs"]
    assert (latest["mode"], latest["in_controller"], latest["written"]) == ("quick", True, True)
    assert first["in_controller"] is False
    assert "quick" in typed_here("history", cell_folder.cell).out
    compared = typed_here("history", cell_folder.cell, "--compare", first["run"], latest["run"])
    assert compared.code == 2  # the one result contains the other
    [status] = typed_here("status", cell_folder.cell, "--json").document["cells"]
    assert status["in_force"] == latest["run"]
    assert typed_here("replay", latest["run"], "--only", "identification").code == 0

    assert typed_here("report", latest["run"]).code == 0
    page = (Path(latest["run"]) / "report.html").read_text()
    assert "Calibration report (quick level)" in page
    assert "that the last calibration left" in page
    assert typed_here("report", latest["run"], "--compare", first["run"]).code == 2
