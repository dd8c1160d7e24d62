"""The geometries that commanded the records of a run, for its measurement file."""

from __future__ import annotations

from hexacell.errors import HexacellError
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.runs.run_folder import RunFolder
from procedures.journal.journal import read_journal
from procedures.run.state import fold


def commanding_geometries(folder: RunFolder, mechanism: Mechanism) -> tuple[CommandingGeometry, ...]:
    """By the journal of a run: that of its controller, and a provisional one in the same frames.

    None if the folder is not that of a run of such a mechanism.
    """
    try:
        state = fold(read_journal(folder.journal))
    except HexacellError:
        return ()
    started, parameters = state.started, mechanism.parameters
    if started is None or set(started.controller) != set(parameters.shapes):
        return ()
    own = CommandingGeometry.of(mechanism, Geometry.of(parameters, started.controller))
    if state.provisional is None:
        return (own,)
    lent = Geometry.of(parameters, state.provisional.geometry)
    return own, CommandingGeometry(lent, own.frames)
