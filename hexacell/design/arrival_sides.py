"""The sides from which joints arrive at a selected pose, chosen for what the record then tells.

Lost motion shows in the difference between records at which a joint arrived from either side. As poses
come, joints that act alike arrive alike, and their coefficients are hard to tell apart. Over a waypoint at
which each joint stands short of its place, or beyond it, any combination of sides is possible.
"""

from itertools import product

import numpy as np

from hexacell.design.candidates import outcomes_of
from hexacell.design.criteria import D_OPTIMAL, Criterion
from hexacell.design.pose_selection import SelectedPose
from hexacell.design.predicted_records import GaugeZero, predict_records
from hexacell.design.travel_monte_carlo import TravelConstraint
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.overshoot import clear_waypoint_before
from hexacell.motion.paths import PathPlanner

WORTH_A_MOVE = 1.05
"""How much more than straight a record must gain over a waypoint, which takes a move more: so about half
of them go over one, and coefficients are known better by a fifth."""

MOST_TRIED = 6
"""The best combinations whose waypoints are checked: they differ by little."""


def with_best_sides(
    planner: PathPlanner,
    zero: GaugeZero,
    selected: SelectedPose,
    back: float,
    criterion: Criterion = D_OPTIMAL,
    known_then: Array | None = None,
) -> SelectedPose:
    """A selected pose, over a waypoint before it where other sides gain more; else as it is.

    At the waypoint every joint stands beside its place by ``back``, in its unit; 0 for no waypoint. Sides
    are selected as the pose was, see :func:`.select_pose`.
    """
    belief, straight = planner.belief, selected.record
    if not back or belief.terms is None or not any(one.needs_directions for one in belief.terms.terms):
        return selected
    covariance = belief.joint_covariance if known_then is None else known_then
    sides = np.array(list(product((1.0, -1.0), repeat=belief.mechanism.joint_count)))
    records = predict_records(belief, zero, straight.targets[np.zeros(len(sides), dtype=np.intp)], sides)
    gains = criterion.gain(covariance, records.jacobian, records.covariance)
    least = WORTH_A_MOVE * criterion.gain(covariance, straight.jacobian, straight.covariance)[0]
    start = PoseBatch.of(selected.waypoints[-1:]) if selected.waypoints else planner.start
    stop, travel = PoseBatch.of([selected.command]), TravelConstraint(belief, zero)
    for row in np.argsort(-gains)[:MOST_TRIED]:
        if gains[row] < least:
            break
        waypoint = clear_waypoint_before(belief, start, stop, back * sides[row], zero.reference)
        if waypoint is None:
            continue
        there, _ = outcomes_of(belief, waypoint)
        if len(there) and travel.holds(predict_records(belief, zero, there)).all():
            record = records[[row]]
            gain = D_OPTIMAL.gain(belief.joint_covariance, record.jacobian, record.covariance)
            waypoints = (*selected.waypoints, waypoint.pose(0))
            return SelectedPose(selected.command, record, float(gain[0]), waypoints)
    return selected
