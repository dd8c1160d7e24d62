"""Before a move: the robot still stands where it arrived last, from where the way was planned.

While a run is paused, or waits for a person, somebody may have moved the robot with its own controller.
"""

from __future__ import annotations

import numpy as np

from drivers.interfaces import Controller
from hexacell.cell.controller import ControllerSettings
from hexacell.kinematics.pose import Pose
from procedures.guards.guards import Guards
from procedures.run.state import RunState
from procedures.run.steps import SixNumbers
from procedures.run.trips import Guard, Trip


def is_at(here: Pose, target: SixNumbers, settings: ControllerSettings) -> bool:
    """Whether a reported pose is a commanded one; each may be off by the tolerance of an arrival."""
    there = Pose(*target)
    position = np.abs(here.position - there.position).max()
    angle = np.degrees(np.abs(here.rotation - there.rotation).max())
    is_near = position <= 2.0 * settings.position_tolerance_mm
    return bool(is_near and angle <= 2.0 * settings.angle_tolerance_deg)


async def require_undisturbed(
    state: RunState, controller: Controller, guards: Guards, settings: ControllerSettings
) -> None:
    """Make sure that the robot is where the run left it; nothing moves.

    Raises:
        GuardTripped: it is somewhere else, or where it is, is not known.
    """
    guards.supervisor.check()
    if state.target is None or state.position_unknown:
        return
    reported = await controller.position()
    if reported is not None and is_at(reported.pose, state.target, settings):
        return
    here = (await guards.locate()).pose
    if not is_at(here, state.target, settings):
        problem = f"the robot is at {here} and not at {Pose(*state.target)}, where it arrived: it was moved"
        action = "Retry: the run then plans its way from where the robot is"
        raise guards.supervisor.latch(Trip(Guard.POSITION, "controller", problem, action))
