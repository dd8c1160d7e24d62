"""Predicted pose errors, against a simulated machine."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hexacell.identification.diagnostics.pose_accuracy import Accuracy, predicted_accuracy
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.hexacell.conftest import reached, vector
from tests.hexacell.uncertainty.conftest import belief_of

DRAWS = 60


def accuracy_of(*machine: Any, task: PoseBatch, workspace: PoseBatch) -> Accuracy:
    found = predicted_accuracy(belief_of(*machine), task=task, workspace=workspace)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def workspace(paper):
    angles = [(0.0, 0.0, 0.0), (12.0, 0.0, 0.0), (0.0, -12.0, 5.0)]
    return [Pose(x, y, z, *turn) for (x, y, z), turn in product(paper.points[:4].tolist(), angles)]


@pytest.fixture(scope="module")
def task():
    return [Pose(50.0, -50.0, 550.0, 5.0, 5.0, 0.0), Pose(-50.0, 80.0, 500.0, 0.0, -10.0, 10.0)]


@pytest.fixture
def stated(identified, paper, workspace, task):
    machine, at = (identified, paper.nominal, paper.branch), PoseBatch.of(workspace)
    return accuracy_of(*machine, task=PoseBatch.of(task), workspace=at)


def errors_after_teaching(reached, commanded, taught_on, length):
    """Errors (n, 2) in mm and rad, frames chosen by scipy's least squares on some rows."""
    positions, turns = reached[:, :3], Rotation.from_rotvec(reached[:, 3:])
    wanted, wanted_turns = commanded[:, :3], Rotation.from_rotvec(commanded[:, 3:])

    def errors(frames):
        shift, base, platform = frames.reshape(3, 3)
        seen = Rotation.from_rotvec(base).apply(positions) + shift
        seen_turns = Rotation.from_rotvec(base) * turns * Rotation.from_rotvec(platform)
        return np.hstack([seen - wanted, (seen_turns * wanted_turns.inv()).as_rotvec()])

    weights = np.repeat([1.0, length], 3)

    def weighted(frames: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(errors(frames)[taught_on] * weights).ravel()

    left = errors(least_squares(weighted, np.zeros(9), x_scale="jac", xtol=1e-14).x)
    return np.stack([np.linalg.norm(left[:, :3], axis=1), np.linalg.norm(left[:, 3:], axis=1)], axis=1)


def test_before_is_what_a_machine_like_the_estimate_does(identified, paper, workspace, task, stated):
    commands = [*workspace, *task]
    seen = np.array([reached(identified.geometry, paper.nominal, pose)[1] for pose in commands])
    radius = np.linalg.norm(identified.geometry["B"], axis=1).mean()
    rows = slice(0, len(workspace))
    left = errors_after_teaching(seen, np.array([vector(p) for p in commands]), rows, radius)
    found = stated
    np.testing.assert_allclose(found.before.distances_mm, left[-2:, 0], rtol=1e-5)
    np.testing.assert_allclose(found.before.angles, left[-2:, 1], rtol=1e-5)
    assert found.before.position_largest_mm == pytest.approx(left[-2:, 0].max(), rel=1e-5)
    rms = np.degrees(np.sqrt(np.mean(left[-2:, 1] ** 2)))
    assert found.before.orientation_rms_deg == pytest.approx(rms, rel=1e-5)


def test_after_is_the_scatter_of_machines_that_the_covariance_allows(
    identified, legs, workspace, task, stated
):
    commands = np.array([vector(pose) for pose in [*workspace, *task]])
    joints = [legs(identified.geometry).joints(command) for command in commands]
    radius = np.linalg.norm(identified.geometry["B"], axis=1).mean()
    random = np.random.default_rng(8)
    squares = []
    for _ in range(DRAWS):
        free = random.multivariate_normal(identified.free, identified.free_covariance)
        machine = legs(Geometry(HEXAGLIDE_PARAMETERS, identified.problem.basis @ free))
        reached = np.array([machine.closed(q, near) for q, near in zip(joints, commands, strict=True)])
        left = errors_after_teaching(reached, commands, slice(0, len(workspace)), radius)
        squares.append(np.mean(left[-2:] ** 2, axis=0))
    found = stated
    told = np.array([np.mean(found.after.distances_mm**2), np.mean(found.after.angles**2)])
    standard_error = np.std(squares, axis=0, ddof=1) / np.sqrt(DRAWS)
    assert (np.abs(np.mean(squares, axis=0) - told) < 4.0 * standard_error).all()
    assert (standard_error < 0.2 * told).all()


def test_unreachable_poses_are_named_and_left_out(identified, paper, workspace, task):
    far = Pose(0.0, 900.0, 550.0)
    found = accuracy_of(
        identified,
        paper.nominal,
        paper.branch,
        task=PoseBatch.of([task[0], far, task[1]]),
        workspace=PoseBatch.of(workspace),
    )
    assert found.reachable.tolist() == [True, False, True]
    assert len(found.poses) == len(found.before.distances_mm) == len(found.after.angles) == 2
    for nowhere in ([far], []):
        nothing = predicted_accuracy(
            belief_of(identified, paper.nominal, paper.branch),
            task=PoseBatch.of(nowhere),
            workspace=PoseBatch.of(workspace),
        )
        assert nothing is None
