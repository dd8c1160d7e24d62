"""Whether a plan can work at all: what its points and limits make impossible, before anything moves."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, pairwise
from math import ceil

import numpy as np

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.planner import Plan
from hexacell.cell.measuring import MOST_RECORDS
from hexacell.design.predicted_records import GaugeZero, estimate_gauge_zero
from hexacell.errors import HexacellError, LimitError, ReachError, UsageError
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import AXES, Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.lengths import rounded_up, shown
from hexacell.limits.leg_limits import ROUNDING
from hexacell.motion.path_check import is_clear
from hexacell.robot.model import Robot
from hexacell.robot.virtual_robot import VirtualRobot, robots_within_tolerances
from hexacell.uncertainty.effect_kinds import COMMON_SCALE
from hexacell.uncertainty.statement import COVERAGE_FACTOR

LARGEST_SHARE = 0.5
"""Share of the robots within the tolerances that may be unable to take the reference of a point."""

LARGEST_SHARE_UNKNOWN = 0.5
"""Share of the error at the worst task pose that records may leave of what the drawing does; with more the
robot would hardly be better."""

TIMES_THE_LIMIT = 10.0
"""Times the limit that the error may be predicted to be, with two sigma: a plan that leaves more measures
too little, whatever the noise."""


def reach_failures(plan: Plan) -> Iterator[HexacellError]:
    """Poses stated by the cell, points or a list, that the controller cannot take within the limits."""
    for point in plan.points:
        yield from pose_failures(plan, f"identification point {point}", plan.reference_pose(point))
        for number, pose in enumerate(plan.poses_at(point)[1:], start=2):
            name = f"point {point}, pose {number} of the list"
            yield from [*pose_failures(plan, name, pose), *_out_of_travel(plan, name, point, pose)]


def pose_failures(plan: Plan, name: str, pose: Pose) -> Iterator[HexacellError]:
    """Why the controller cannot take a pose within the limits, if it cannot."""
    for problem in broken_limits(plan.robot, pose):
        yield ReachError(problem, subject=name)


def _out_of_travel(plan: Plan, name: str, point: int, pose: Pose) -> Iterator[HexacellError]:
    """A listed pose too far from its reference. Positions of measured files contain the robot's error."""
    travel = plan.settings.limits.gauge_travel_mm
    error = plan.robot.tolerances.sum_mm(plan.robot.mechanism.parameters)
    apart = float(np.abs(pose.position - plan.reference_pose(point).position).max())
    if apart > travel + error:
        yield ReachError(
            f"is {apart:.1f} mm from its reference, where the gauges reach {travel:g}", subject=name
        )


def too_few_records(plan: Plan) -> Iterator[HexacellError]:
    """The failure that points, orientations and budget give fewer equations than there are parameters."""
    unknowns = plan.robot.unknowns
    planned = plan.forecaster.planned(CampaignState())
    equations = sum(3 * (records - 1) for records in planned.values())
    if equations >= unknowns:
        return
    if 3 * sum(plan.records_at(point) - 1 for point in plan.points) >= unknowns:
        yield UsageError(
            f"the budget of {plan.budget.description} allows {sum(planned.values())} records at "
            f"{len(planned)} points, {equations} equations for {unknowns} parameters",
            subject="[identification]",
            action=f"Allow {_records_needed(plan, unknowns)} records at least",
        )
        return
    points, size = len(plan.points), plan.settings.identification.orientations
    needed = 1 - (-unknowns // (3 * points))
    what = f"{points} points with {size} orientations" if plan.pose_list is None else plan.pose_list.path
    yield UsageError(
        f"{what} give {equations} equations for {unknowns} parameters",
        subject="[identification]",
        action=f"Have at least {needed} orientations at each point",
    )


def _records_needed(plan: Plan, unknowns: int) -> int:
    """The smallest number of records, with the points in their order, that gives enough equations."""
    differences = records = -(-unknowns // 3)
    for point in plan.points:
        if differences <= 0:
            break
        records += 1  # the point's reference
        differences -= plan.records_at(point) - 1
    return records


def optimisation_failures(plan: Plan) -> Iterator[list[HexacellError]]:
    """What prevents a plan whose poses can be reached from identifying the geometry.

    Yields the failures after each part of the work, often an empty list: the caller may stop in between.
    """
    failures: list[HexacellError] = []
    for found in measuring_failures(plan):
        failures += found
        yield found
    if not failures:
        yield [*_beyond_any_records(plan)] or [*_no_better(plan)]


def measuring_failures(plan: Plan) -> Iterator[list[HexacellError]]:
    """What prevents a plan whose poses can be reached from selecting its poses, likewise in parts."""
    if plan.robot.known is None:
        yield [*_unreachable_points(plan)]
    yield [*_blocked_lines(plan)]
    yield from _points_without_poses(plan)


def unreachable_share(plan: Plan) -> dict[int, float]:
    """At each point the share of robots within the tolerances that cannot reach its reference.

    Robots that would have a passive joint or a leg beyond its limits there do not reach it either.
    """
    robot, count, seed = plan.robot, plan.effort.checked_robots, plan.settings.identification.seed
    references = robot.from_commands([plan.reference_pose(point) for point in plan.points])
    robots = [VirtualRobot(robot, truth) for truth in robots_within_tolerances(robot, count, seed)]
    can_stand = np.array([one.can_stand(references) for one in robots])
    return dict(zip(plan.points, (1.0 - can_stand.mean(axis=0)).tolist(), strict=True))


def _unreachable_points(plan: Plan) -> Iterator[HexacellError]:
    for point, share in unreachable_share(plan).items():
        if share > LARGEST_SHARE:
            yield UsageError(
                f"{share:.0%} of the robots within the tolerances cannot reach it, although the "
                "controller computes that it is reachable",
                subject=f"identification point {point}",
                action="Move it away from singularities and from the ends of reach",
            )


def _blocked_lines(plan: Plan) -> Iterator[HexacellError]:
    """Straight lines between points, and between the poses of a list, that are not clear."""
    belief = plan.robot.belief()
    references = {point: plan.robot.from_commands([plan.reference_pose(point)]) for point in plan.points}
    any_order = plan.settings.identification.choose_points
    lines = [
        (f"identification points {start} and {end}", references[start], references[end])
        for start, end in (combinations(plan.points, 2) if any_order else pairwise(plan.points))
    ]
    for point in plan.points if plan.pose_list is not None else ():
        listed = plan.robot.from_commands(plan.poses_at(point))
        for row in range(1, len(listed)):
            ends = f"point {point}, poses {row} and {row + 1} of the list"
            lines.append((ends, listed[[row - 1]], listed[[row]]))
    for ends, start, end in lines:
        if not is_clear(belief, start, end):
            yield ReachError(
                "the straight line between them leaves the joint ranges or comes next to a singularity",
                subject=ends,
                action="Put one between them, or change their order",
            )


def _points_without_poses(plan: Plan) -> Iterator[list[HexacellError]]:
    """Points at which no pose is safe: the first ones as known now, the others as known later."""
    fewer = min(plan.effort.candidates, plan.effort.checked_candidates)
    plan = replace(plan, effort=replace(plan.effort, candidates=fewer))
    now, later = plan.robot.belief(), plan.predicted_belief()
    failures: dict[int, HexacellError | None] = {}
    for point in plan.points:
        failures[point] = _no_safe_pose(plan, now, point)
        yield []
    first_points = list(plan.points if plan.settings.identification.choose_points else plan.points[:1])
    if all(failures[point] for point in first_points):
        yield [error for point in first_points if (error := failures[point])]
    for point in plan.points:
        if point not in first_points and failures[point]:
            yield [error for error in [_no_safe_pose(plan, later, point)] if error]


def _no_safe_pose(plan: Plan, belief: RobotBelief, point: int) -> HexacellError | None:
    """The reason if no record after a point's reference is possible."""
    try:
        plan.chooser.choose(belief, _expected_zero(plan, belief, point), CampaignState(point=point))
    except LimitError as error:
        travel = plan.settings.limits.gauge_travel_mm
        return UsageError(
            error.problem,
            subject=f"identification point {point}",
            action=f"gauge_travel_mm = {travel:g} is too little for these tolerances and this noise, "
            "or tilt_deg, joint ranges or singularity_margin leave no room",
        )
    return None


def _expected_zero(plan: Plan, belief: RobotBelief, point: int) -> GaugeZero:
    """The gauges' zero after the reference was measured, if the robot is as estimated."""
    actual = belief.commanded.actual_poses(plan.robot.from_commands([plan.reference_pose(point)]))
    if not actual.found[0]:
        raise LimitError("the robot as drawn cannot reach the pose that the controller would command")
    return estimate_gauge_zero(belief, actual.poses, actual.joints, np.zeros((1, 3)))


def _beyond_any_records(plan: Plan) -> Iterator[HexacellError]:
    """The failure that what is not known of the machine exceeds a limit, however much is measured."""
    budget, limits = plan.planned_budget, plan.settings.acceptance.of_errors
    if budget is None:
        return
    measured = () if plan.settings.length_check is None else (COMMON_SCALE,)
    lines = (line for line in budget.lines if line.combined_mm and line.effect.name not in measured)
    parts = sorted(lines, key=lambda line: -line.combined_mm)
    names = ", ".join(f"{one.effect.name} ({shown(one.combined_mm)})" for one in parts[:3])
    floor = budget.floor(measured)
    for key, error in (("position_mm", floor.position), ("orientation_deg", floor.orientation)):
        least, limit = limits.guard_band_factor * error.expanded, getattr(limits, key)
        if least > limit:
            yield UsageError(
                f"no number of records reaches {key} = {limit:g}: what they cannot show makes {least:.3g} "
                f"at the worst task pose by itself, most of it by {names}",
                subject="[acceptance]",
                action=f"State {key} = {rounded_up(least):g} or more; or have these parts measured, and "
                "state smaller sizes of them in [uncertainty], and of repeatability in [noise]",
            )


def records_for(limit: float, records: int, by_noise: float, other: float) -> int | None:
    """How many records a limit needs, of which some leave errors ``by_noise`` and ``other``; or None."""
    room = limit**2 - other**2
    return None if room <= 0.0 else ceil(records * by_noise**2 / room)


def _no_better(plan: Plan) -> Iterator[HexacellError]:
    """The failure that even well spread poses tell hardly more of the task poses than the drawing does.

    Parameters that hardly move a task pose may stay as the drawing has them; U contains that.
    """
    start = CampaignState()
    now = plan.forecaster.worst_error(start, plan.robot.belief())
    end = plan.forecaster.worst_error(start, plan.predicted_belief())
    limit = plan.settings.acceptance.position_mm
    if now is None or end is None or COVERAGE_FACTOR * end <= limit:
        return
    if end <= LARGEST_SHARE_UNKNOWN * now and COVERAGE_FACTOR * end <= TIMES_THE_LIMIT * limit:
        return
    records = sum(plan.forecaster.planned(start).values())
    needed = records_for(limit / COVERAGE_FACTOR, records, end, plan.systematic_mm or 0.0)
    enough = f"some {needed} records" if needed and needed <= MOST_RECORDS else "more orientations"
    yield UsageError(
        f"{records} records leave an error of {end:.3g} mm at the worst task pose, one sigma, where the "
        f"limit is {limit:g} and the drawing with its tolerances leaves {now:.3g}",
        subject="[identification]",
        action=f"Allow more tilt, {enough}, or points farther apart; gauges and encoders of "
        "another noise need other figures in [noise]",
    )


def broken_limits(robot: Robot, pose: Pose) -> Iterator[str]:
    """What is wrong with a pose in the controller's frames: a sentence for each limit, with its value.

    Passive joints and legs are those of the geometry that the controller has.
    """
    yield from _of_command(robot, pose)
    poses = robot.from_commands([pose])
    try:
        joints = inverse_kinematics(robot.mechanism, robot.controller, robot.branch, PoseBatch.of([pose]))
    except ReachError as error:
        yield error.problem
        return
    unit = robot.mechanism.words.joint_unit
    for leg, (lowest, highest) in enumerate(robot.limits.joint_ranges):
        if not lowest <= joints[0, leg] <= highest:
            yield f"q{leg + 1} would be {joints[0, leg]:.1f} {unit}, outside {lowest:g} to {highest:g}"
    margin = singularity_margin(robot.mechanism, robot.commanding, poses, joints)[0]
    if margin < robot.limits.singularity_margin:
        yield f"the singularity margin is {margin:.3f}, below {robot.limits.singularity_margin:g}"
    yield from _of_legs(robot, poses, joints)


def _of_command(robot: Robot, pose: Pose) -> Iterator[str]:
    command, limits = PoseBatch.of([pose]), robot.limits
    for name, key, angle, largest in (
        ("is tilted", "tilt_deg", command.tilts()[0], limits.tilt),
        ("is turned about its normal", "turn_deg", abs(command.turns()[0]), limits.turn),
    ):
        if angle > largest + ROUNDING:
            yield f"{name} by {np.degrees(angle):.1f} deg, beyond {key} = {np.degrees(largest):g}"
    numbers, axes = command.numbers()[0], limits.axes
    for axis, number, low, high in zip(AXES, numbers, axes.lowest, axes.highest, strict=True):
        if not low - ROUNDING <= number <= high + ROUNDING:
            yield f"axis {axis} would be at {number:.1f}, outside {low:g} to {high:g}"


def _of_legs(robot: Robot, poses: PoseBatch, joints: Array) -> Iterator[str]:
    if (limits := robot.limits.legs) is None:
        return
    legs = robot.mechanism.legs(robot.commanding, poses, joints)
    spare = limits.margins(legs)[0, : 2 * len(limits.base_cones)].reshape(2, -1)
    stated = limits.base_cones, limits.platform_cones
    for where, cones, left in zip(("base", "platform"), stated, spare, strict=True):
        if left.min() < 0.0:
            leg = int(np.argmin(left))
            turned, cone = np.degrees([cones[leg] - left[leg], cones[leg]])
            yield f"leg {leg + 1} is turned by {turned:.1f} deg in its {where} joint, beyond {cone:g}"
    distance = legs.smallest_distance()[0]
    if distance < limits.distance_mm:
        yield f"two legs come within {distance:.1f} mm, leg_distance_mm is {limits.distance_mm:g}"
