"""What other packages may rely on: the names, and that they work together as the interface says."""

import subprocess
import sys

import pytest

from hexacell import api
from hexacell.campaign.decisions import StartPoint
from hexacell.cell.bundled import bundled_config
from hexacell.errors import UsageError
from hexacell.measurements.csv_file import write_measurements


@pytest.fixture
def cell() -> api.Cell:
    return api.load_cell(bundled_config("simulated-hexaglide"))


def test_records_are_read_and_fitted(cell, noisy, tmp_path) -> None:
    path = tmp_path / "measurements.csv"
    write_measurements(path, noisy)
    found = api.fit_measurements(cell, api.read_measurements(path))
    assert isinstance(found, api.Assessment)
    assert found.is_usable


def test_a_next_pose_needs_no_records(cell) -> None:
    decision = api.next_pose(cell, api.MeasurementSet(())).decision
    assert isinstance(decision, StartPoint)
    assert decision.point == 1


def test_what_is_no_run_is_refused(tmp_path) -> None:
    with pytest.raises(UsageError, match="this is no run folder"):
        api.reported_run(tmp_path)


EVENTS = {"procedures.steps.events", "procedures.steps"}
HEAVY = {"textual", "matplotlib", "sqlalchemy", "canopen", "rich", *EVENTS}
FIT = """
from pathlib import Path
from hexacell import api
cell, measurements = Path(sys.argv[1]), Path(sys.argv[2])
assert api.fit_measurements(api.load_cell(cell), api.read_measurements(measurements)).is_usable
"""
COMMAND = """
from hexacell.cli.app import main
main(sys.argv[3:])
"""


@pytest.mark.sample("api")
@pytest.mark.parametrize(
    ("program", "command", "not_loaded"),
    [
        ("import hexacell.api", [], {"numpy", "pydantic", *HEAVY}),
        (FIT, [], HEAVY),
        (COMMAND, ["fit", "CELL", "--measurements", "CSV"], HEAVY),
        (COMMAND, ["status", "CELL"], {*HEAVY, "scipy"} - {"sqlalchemy"}),
        (COMMAND, ["cell", "show", "CELL"], {*HEAVY, "scipy", "procedures"}),
        (COMMAND, ["cell", "validate", "CELL"], {*HEAVY, "scipy", "procedures"} - {"canopen"}),
    ],
    ids=["api", "fit by the api", "fit", "status", "cell show", "cell validate"],
)
def test_what_is_not_needed_is_not_imported(noisy, tmp_path, program, command, not_loaded) -> None:
    """Measured as modules, not as seconds: what each of them costs is in ``python -X importtime``."""
    cell, path = bundled_config("simulated-hexaglide"), tmp_path / "measurements.csv"
    write_measurements(path, noisy)
    names = {"CELL": str(cell), "CSV": str(path)}
    words = [str(cell), str(path), *(names.get(word, word) for word in command)]
    code = f"import sys\n{program}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines()[-1].split())
    assert "hexacell" in loaded
    assert loaded & not_loaded == set()
