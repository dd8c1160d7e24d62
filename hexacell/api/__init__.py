"""The program from Python: cells, devices live, runs, results by name, fits and studies on arrays.

Every name is importable from here. Lengths are mm, angles of poses deg. Errors are :class:`HexacellError`,
with a message for people and the next action. Nothing moves a robot but a run, and a run does not begin
without ``moves_robot=True``, a person's word. What blocks works in scripts and in notebooks, whose event
loop goes on where ``async for`` or ``await`` stands instead.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hexacell.api.devices import LiveDevices
    from hexacell.api.result import Result, fit, frame, read_result
    from hexacell.api.run import Run, RunEvent, attach_to_run, resume_run, start_run
    from hexacell.api.study import study
    from hexacell.cell.loader import Cell, load_cell
    from hexacell.errors import HexacellError
    from hexacell.measurements.columns import columns_of, measurements_of
    from hexacell.measurements.csv_file import read_measurements
    from hexacell.measurements.records import MeasurementSet, Record
    from hexacell.run_process.live_snapshot import LiveSnapshot
    from hexacell.services.history.reported_run import ReportedRun, reported_run
    from hexacell.services.offline import NextPose, fit_measurements, next_pose
    from hexacell.services.run.demo import simulated_cell
    from hexacell.verdict.assessment import Assessment
    from procedures.run.questions import Question
else:
    _ROOMS = {
        "hexacell.api.devices": "LiveDevices",
        "hexacell.api.result": "Result fit frame read_result",
        "hexacell.api.run": "Run RunEvent attach_to_run resume_run start_run",
        "hexacell.api.study": "study",
        "hexacell.cell.loader": "Cell load_cell",
        "hexacell.errors": "HexacellError",
        "hexacell.measurements.columns": "columns_of measurements_of",
        "hexacell.measurements.csv_file": "read_measurements",
        "hexacell.measurements.records": "MeasurementSet Record",
        "hexacell.run_process.live_snapshot": "LiveSnapshot",
        "hexacell.services.history.reported_run": "ReportedRun reported_run",
        "hexacell.services.offline": "NextPose fit_measurements next_pose",
        "hexacell.services.run.demo": "simulated_cell",
        "hexacell.verdict.assessment": "Assessment",
        "procedures.run.questions": "Question",
    }
    _MODULES = {name: room for room, names in _ROOMS.items() for name in names.split()}

    def __dir__():  # noqa: ANN202 - not seen by type checkers, which see the imports above
        """What a notebook offers to complete."""
        return sorted(_MODULES)

    def __getattr__(name):  # noqa: ANN001, ANN202 - likewise
        """Import a name when it is first used: whoever fits records does not wait for the rest."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = globals()[name] = getattr(import_module(_MODULES[name]), name)
        return found
