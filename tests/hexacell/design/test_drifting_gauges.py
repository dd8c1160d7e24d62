"""Poses chosen by the covariance of drifting gauges gain next to nothing: they are chosen as without."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.design.candidates import orientations, reachable
from hexacell.design.predicted_records import position_derivatives
from hexacell.identification.problem.random_walk import GaugeWalk, walk_columns
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.services.offline import plan_of


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.3, 1.0])
def test_poses_chosen_one_after_the_other_do_not_make_up_for_a_drift(ratio: float) -> None:
    """By steps of so much of a record's noise; every set of eleven ends with its reference."""
    plan = plan_of(load_cell(bundled_config("simulated-hexaglide")))
    belief, task = plan.robot.belief(), plan.task.error(plan.robot.belief())
    assert task is not None
    turns = belief.limits.orientations(orientations(128, belief.limits.tilt, 3, most_twist=1.0))
    balls = plan.robot.from_commands(map(plan.reference_pose, plan.points)).positions
    sets = [position_derivatives(belief, reachable(belief, PoseBatch.at(ball, turns))[0]) for ball in balls]
    noise = [belief.noise.record_covariance(by_joints) for _, by_joints in sets]
    drift_mm, prior = ratio * np.sqrt(noise[0][0].trace() / 3.0), np.linalg.inv(belief.joint_covariance)

    def information(at: int, rows: list[int], step_mm: float) -> Array:
        rows = [*rows, rows[0]]
        walk = walk_columns(np.array([0]), len(rows), GaugeWalk(step_mm)).reshape(3 * len(rows), -1)
        zero = np.tile(1e4 * np.eye(3), (len(rows), len(rows)))
        jacobian = sets[at][0][rows].reshape(len(zero), -1)
        covariance = block_diag(*noise[at][rows]) + walk @ walk.T + zero
        return np.asarray(jacobian.T @ np.linalg.solve(covariance, jacobian))

    def mean_square(step_mm: float) -> float:
        total = drifting = prior
        for at in range(len(sets)):
            rows, others = [0], list(range(1, len(noise[at])))
            while len(rows) < 11:
                sums = [total + information(at, [*rows, row], step_mm) for row in others]
                rows.append(others.pop(int(np.linalg.slogdet(sums)[1].argmax())))
            total = total + information(at, rows, step_mm)
            drifting = drifting + information(at, rows, drift_mm)
        return task.mean_square(np.linalg.inv(drifting))

    assert mean_square(drift_mm) > 0.94 * mean_square(0.0), "3 % of the error"
