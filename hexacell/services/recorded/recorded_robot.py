"""The robot of a recorded run: as it was when the run began, which geometries it had, its noise."""

from hexacell.cell.model import CellSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.errors import HexacellError
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.kinematics.geometry import Geometry
from hexacell.noise.measured_noise import MeasuredNoise
from hexacell.robot.model import Robot, make_robot
from hexacell.runs.run_folder import RunFolder
from hexacell.services.recorded.journal_soundness import read_sound
from procedures.run.state import RunState
from procedures.steps.events import RunStarted


def started_robot(settings: CellSettings, started: RunStarted) -> Robot:
    """The robot by a cell's settings, which may be newer, and its controller when a run began."""
    parameters = settings.mechanism.parameters
    geometry = Geometry.of(parameters, started.controller)
    commanding = ControllerGeometry(geometry, started.branch, started.limits)
    return make_robot(settings, commanding, taught=Geometry.of(parameters, started.taught))


def geometry_before(settings: CellSettings, started: RunStarted) -> Geometry:
    """The controller's geometry when the run began, in the mechanism's frame convention."""
    mechanism = settings.mechanism
    return mechanism.normalize_frames(Geometry.of(mechanism.parameters, started.controller))[0]


def noise_of_run(folder: RunFolder, settings: CellSettings) -> MeasuredNoise | None:
    """The noise that a run measured; None if it did not, or the folder is not that of a run."""
    measured = _state_of(folder, settings).noise
    return None if measured is None else measured.noise


def commanding_geometries(folder: RunFolder, settings: CellSettings) -> tuple[CommandingGeometry, ...]:
    """The geometries that commanded a run: its controller's, and a provisional one in the same frames.

    Empty if the folder is not that of a run of such a mechanism.
    """
    state, mechanism = _state_of(folder, settings), settings.mechanism
    started, parameters = state.started, mechanism.parameters
    if started is None:
        return ()
    own = CommandingGeometry.of(mechanism, Geometry.of(parameters, started.controller))
    if state.provisional is None:
        return (own,)
    lent = Geometry.of(parameters, state.provisional.geometry)
    return own, CommandingGeometry(lent, own.frames)


def _state_of(folder: RunFolder, settings: CellSettings) -> RunState:
    """State of a run; empty if its journal cannot be read, or is of another kind of machine."""
    try:
        return read_sound(folder, settings)[1]
    except HexacellError:
        return RunState()
