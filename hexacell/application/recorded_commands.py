"""What the journal of a run tells of its measurement file: the geometries in command, and the noise."""

from __future__ import annotations

from hexacell.campaign.measured_noise import MeasuredNoise
from hexacell.errors import HexacellError
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.runs.run_folder import RunFolder
from procedures.journal.journal import read_journal
from procedures.run.state import RunState, fold


def noise_of_run(folder: RunFolder) -> MeasuredNoise | None:
    """The noise that a run measured; none if it did not, or the folder is not that of a run."""
    measured = _state_of(folder).noise
    return None if measured is None else measured.noise


def commanding_geometries(folder: RunFolder, mechanism: Mechanism) -> tuple[CommandingGeometry, ...]:
    """By the journal of a run: that of its controller, and a provisional one in the same frames.

    None if the folder is not that of a run of such a mechanism.
    """
    state = _state_of(folder)
    started, parameters = state.started, mechanism.parameters
    if started is None or set(started.controller) != set(parameters.shapes):
        return ()
    own = CommandingGeometry.of(mechanism, Geometry.of(parameters, started.controller))
    if state.provisional is None:
        return (own,)
    lent = Geometry.of(parameters, state.provisional.geometry)
    return own, CommandingGeometry(lent, own.frames)


def _state_of(folder: RunFolder) -> RunState:
    """A run as far as it got; empty if its journal cannot be read."""
    try:
        return fold(read_journal(folder.journal))
    except HexacellError:
        return RunState()
