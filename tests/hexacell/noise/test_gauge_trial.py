"""Gauges judged by what they showed after small known moves, on robots drawn within their tolerances."""

from itertools import permutations, product

import numpy as np
import pytest

from hexacell.kinematics import rotations
from hexacell.kinematics.pose import Pose
from hexacell.noise.gauge_trial import GaugeMistake, GaugeTrial, judge_response
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot, robots_within_tolerances

DEAD, INCHES, MICROMETRES, REVERSED, EXCHANGED = GaugeMistake
NOISE_MM = 0.014
HAND_DEG = 2.0


@pytest.fixture(scope="module")
def responses(bundled_cell) -> np.ndarray:
    """(n, 3, 3) of drawn robots at the cell's points, by gauges off their axes, with noise."""
    robot, random = robot_of(bundled_cell), np.random.default_rng(4)
    found = []
    for point in bundled_cell.settings.identification.points[:3]:
        poses = [Pose(*point), *(Pose(*(np.array(point) + move)) for move in np.eye(3))]
        commands = robot.from_commands(poses)
        for truth in robots_within_tolerances(robot, 60, seed=11):
            virtual = VirtualRobot(robot, truth)
            if not virtual.can_take(commands).all():
                continue
            positions = virtual.actual_poses(commands).poses.positions
            triad = rotations.from_vector(np.radians(HAND_DEG) * random.standard_normal(3))
            shown = (positions[1:] - positions[0]) @ triad.T + NOISE_MM * random.standard_normal((3, 3))
            found.append(GaugeTrial(np.eye(3), shown).response)
    return np.array(found)


def test_healthy_gauges_pass_on_every_robot(responses) -> None:
    assert len(responses) > 150
    assert np.abs(responses - np.eye(3)).max() > 0.5, "some robots go elsewhere"
    assert not [judge_response(response) for response in responses if judge_response(response)]


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_exchanged_gauges_are_named_on_every_robot(responses, pair) -> None:
    order = [0, 1, 2]
    order[pair[0]], order[pair[1]] = pair[1], pair[0]
    findings = [judge_response(response[order]) for response in responses]
    assert all(findings)
    # Where the ball goes at 45 degrees to its command, exchanged and reversed gauges show the same.
    assert sum(found != {EXCHANGED: [*pair]} for found in findings) <= 1


@pytest.mark.parametrize("gauge", [0, 1, 2])
@pytest.mark.parametrize(
    ("factor", "mistake"),
    [(-1.0, REVERSED), (1.0 / 25.4, INCHES), (1e3, MICROMETRES), (0.0, DEAD), (0.004, DEAD)],
)
def test_a_single_gauge_is_named_on_every_robot(responses, gauge, factor, mistake) -> None:
    findings = []
    for response in responses:
        false = response.copy()
        false[gauge] *= factor
        findings.append(judge_response(false))
    assert all(findings)
    assert sum(found != {mistake: [gauge]} for found in findings) <= 1


def test_all_assignments_with_all_signs_are_told_apart() -> None:
    for axes, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        named = judge_response(np.diag(signs) @ np.eye(3)[list(axes)])
        assert named.get(EXCHANGED, []) == [n for n, axis in enumerate(axes) if n != axis]
        assert named.get(REVERSED, []) == [n for n, sign in enumerate(signs) if sign < 0]


def test_three_dead_gauges_are_all_named() -> None:
    assert judge_response(np.zeros((3, 3))) == {DEAD: [0, 1, 2]}


def test_the_response_is_by_gauge_and_axis_whatever_the_moves() -> None:
    response = np.array([[1.0, 0.1, 0.0], [0.0, 0.9, 0.2], [0.3, 0.0, 1.1]])
    moved = np.diag([1.0, -1.0, 0.5])
    assert GaugeTrial(moved, moved @ response.T).response == pytest.approx(response)


ROUNDS = np.concatenate([length * np.eye(3) for length in (1.0, 1.5, 1.5)])
"""The moves of a trial that is repeated."""


def shown_by(signs, scatter_mm, random) -> GaugeTrial:
    """Gauges on a machine that does not repeat; the reading at the reference is off by as much."""
    errors = scatter_mm * (random.standard_normal((len(ROUNDS), 3)) - random.standard_normal(3))
    return GaugeTrial(ROUNDS, (ROUNDS + errors) * signs)


@pytest.mark.parametrize("scatter_mm", [0.0, 0.1, 0.5, 1.5])
def test_no_gauge_is_blamed_for_a_machine_that_does_not_repeat(scatter_mm) -> None:
    random = np.random.default_rng(3)
    trials = [shown_by(np.ones(3), scatter_mm, random) for _ in range(400)]
    assert sum(bool(trial.findings) for trial in trials) <= 1
    assert scatter_mm < 0.5 or any(judge_response(trial.response) for trial in trials)


@pytest.mark.parametrize("scatter_mm", [0.0, 0.1, 0.2])
def test_a_reversed_gauge_is_named_on_such_a_machine(scatter_mm) -> None:
    random = np.random.default_rng(4)
    trials = [shown_by(np.array([1.0, -1.0, 1.0]), scatter_mm, random) for _ in range(200)]
    assert np.mean([trial.findings.get(REVERSED) == [1] for trial in trials]) > 0.98
