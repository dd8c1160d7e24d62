"""What held-out records will add to an identification, and the verdict then, before they are measured."""

from __future__ import annotations

from collections.abc import Iterator

from hexacell.campaign.exact_records import exact_records
from hexacell.campaign.planner import Plan
from hexacell.design import candidates
from hexacell.design.validation_poses import select_near
from hexacell.dry_run.verdict_forecast import VerdictForecast, forecast_verdicts, stated_errors
from hexacell.errors import HexacellError, LimitError
from hexacell.identification.diagnostics.model_tests import update
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot.model import Robot
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.verdict.decision import ErrorLimits


def predicted_verdicts(
    plan: Plan, found: Identification, budget: UncertaintyBudget | None
) -> VerdictForecast | None:
    """What a run will say of healthy machines with this geometry; none where nothing can be said.

    ``budget`` is that of the identification. With zeros alone what is held is as wrong as its
    tolerances say.
    """
    try:
        updated = with_held_out_records(plan, found)
    except HexacellError:
        return None
    after = plan.task.budget(updated, plan.robot.belief(updated), plan.robot.effects)
    if budget is None or after is None or len(after.jacobian) != len(budget.jacobian):
        return None
    limits = ErrorLimits.of(plan.settings.acceptance)
    stated = stated_errors(found, updated, budget, after, plan.robot.identified_zeros(found))
    return forecast_verdicts(stated, after, limits)


def with_held_out_records(plan: Plan, found: Identification) -> Identification:
    """The identification updated by the records that the held-out points will give if it is right.

    They are those of the wide poses after the write-back. The small tilts that are measured before as well
    add little. A point at which the robot takes too few poses adds nothing.

    Raises:
        LimitError: no point has enough of them.
    """
    written = (plan.robot.identified_zeros(found) or found).geometry
    robot = plan.robot.with_controller(plan.robot.for_controller(written))
    records = tuple(_records(plan, robot, found))
    if not records:
        raise LimitError("the robot takes too few poses at each of the held-out points")
    return update(found, robot.problem(MeasurementSet(records)))


def _records(plan: Plan, robot: Robot, found: Identification) -> Iterator[Record]:
    settings, belief = plan.settings.verification, robot.belief(found)
    turns = candidates.orientations(
        plan.effort.forecast_held_out_candidates,
        belief.limits.tilt,
        settings.seed,
        most_twist=belief.limits.turn,
    )
    first, used = 1 + max(plan.points), found.poses.rotations
    own, held_out = plan.settings.identification.points, settings.points
    middle = robot.from_commands(Pose(*point) for point in own).positions.mean(axis=0)
    balls = robot.from_commands(Pose(*point) for point in held_out).positions
    for point, ball in enumerate(balls, start=first):
        try:
            poses = select_near(belief, ball, middle, settings.orientations, turns, used)
        except LimitError:
            continue
        yield from exact_records(robot, point, poses)
