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

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hexacell.cell.loader import Cell, load_cell
    from hexacell.errors import HexacellError
    from hexacell.measurements.csv_file import read_measurements
    from hexacell.measurements.records import MeasurementSet, Record
    from hexacell.services.history.reported_run import ReportedRun, reported_run
    from hexacell.services.offline import NextPose, fit_measurements, next_pose
    from hexacell.verdict.assessment import Assessment
else:
    _MODULES = {
        "Assessment": "verdict.assessment",
        "Cell": "cell.loader",
        "HexacellError": "errors",
        "MeasurementSet": "measurements.records",
        "NextPose": "services.offline",
        "Record": "measurements.records",
        "ReportedRun": "services.history.reported_run",
        "fit_measurements": "services.offline",
        "load_cell": "cell.loader",
        "next_pose": "services.offline",
        "read_measurements": "measurements.csv_file",
        "reported_run": "services.history.reported_run",
    }

    def __getattr__(name):  # noqa: ANN001, ANN202 - not seen by type checkers, which see the imports above
        """Import a name when it is first used: whoever fits records does not wait for the rest."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = globals()[name] = getattr(import_module(f"hexacell.{_MODULES[name]}"), name)
        return found


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
