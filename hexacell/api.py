"""What other packages may rely on: a cell, its records, the next pose, and runs that are over.

For example::

    from pathlib import Path
    from hexacell import api

    cell = api.load_cell(Path("my-robot.toml"))
    measurements = api.read_measurements(Path("measurements.csv"))
    found = api.fit_measurements(cell, measurements)
    proposed = api.next_pose(cell, measurements)
    run = api.reported_run(Path("runs/my-robot/2026-11-20T103000Z"))

Lengths are mm, angles in files deg. Errors are :class:`HexacellError`, with a message for people and the
next action. Nothing here moves a robot.
"""

from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import HexacellError
from hexacell.measurements.csv_file import read_measurements
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.services.history.reported_run import ReportedRun, reported_run
from hexacell.services.offline import NextPose, fit_measurements, next_pose
from hexacell.verdict.assessment import Assessment

__all__ = [
    "Assessment",
    "Cell",
    "HexacellError",
    "MeasurementSet",
    "NextPose",
    "Record",
    "ReportedRun",
    "fit_measurements",
    "load_cell",
    "next_pose",
    "read_measurements",
    "reported_run",
]
