"""What other packages may rely on: the names, and that they work together as the interface says."""

from __future__ import annotations

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


def test_everything_listed_is_there_and_documented() -> None:
    for name in api.__all__:
        assert getattr(api, name).__doc__


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, hexacell; print([m for m in ('numpy', 'scipy', 'pydantic') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


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
