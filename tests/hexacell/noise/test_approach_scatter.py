"""Visits of one pose: what encoders see is no error, what nobody stated is found and named."""

from collections import Counter

import numpy as np
import pytest

from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.sensitivity import POSITION, free_sensitivity
from hexacell.noise.approach_scatter import ScatterSource, approach_scatter
from hexacell.noise.ball_by_encoders import BallByEncoders

NOISE = 0.01
VISITS = 7


@pytest.fixture(scope="module")
def by_joints(hexaglide, paper):
    poses = PoseBatch.of([Pose(0.0, 0.0, 550.0)])
    joints = hexaglide.inverse(paper.nominal, paper.branch, poses)
    return free_sensitivity(hexaglide, paper.nominal, poses, joints, POSITION).joints[0]


@pytest.fixture
def visit(by_joints):
    """Visits of a machine whose stops differ by 20 um, with more that is not stated."""
    random = np.random.default_rng(7)

    def scatter(*, sliders=0.0, encoders=0.0, gauges=(0.0,) * 3, stops=0.02, visits=VISITS, stated=NOISE):
        seen = stops * random.standard_normal((visits, 6))
        joints = seen + np.hypot(NOISE, encoders) * random.standard_normal((visits, 6))
        ball = (seen + sliders * random.standard_normal((visits, 6))) @ by_joints.T
        shown = ball + np.hypot(NOISE, gauges) * random.standard_normal((visits, 3))
        ball = BallByEncoders(by_joints, np.zeros((3, 1, 6)))
        return approach_scatter(shown, joints, ball, np.full(6, stated), np.full(3, stated))

    return scatter


def test_stops_that_the_encoders_see_are_no_scatter(visit) -> None:
    found = [visit() for _ in range(1000)]
    assert np.mean([one.source is not None for one in found]) < 0.005
    assert np.mean([one.ratio**2 for one in found]) == pytest.approx(1.0, abs=0.03)
    assert {one.degrees_of_freedom for one in found} == {3 * (VISITS - 1)}
    assert np.mean([one.ball_mm for one in found]) > 0.05  # the ball moved with them


@pytest.mark.parametrize("stops", [0.01, 0.05, 0.5])
def test_how_far_joints_stop_beside_their_commands(visit, stops) -> None:
    found = [visit(stops=stops).stops for _ in range(300)]
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(stops, rel=0.08)
    assert np.mean([visit(stops=0.0).stops > 0.0 for _ in range(500)]) == pytest.approx(0.05, abs=0.02)


def test_the_upper_limit_of_the_noise_holds_in_95_percent(visit) -> None:
    assert np.mean([visit().ratio_at_most >= 1.0 for _ in range(1000)]) == pytest.approx(0.95, abs=0.025)


@pytest.mark.sample("gauges1-*")
@pytest.mark.parametrize(
    ("gauges", "source"),
    [
        ((0.2, 0.0, 0.0), ScatterSource.GAUGE_X),
        ((0.0, 0.5, 0.0), ScatterSource.GAUGE_Y),
        ((0.0, 0.0, 0.2), ScatterSource.GAUGE_Z),
    ],
)
def test_a_gauge_that_does_not_repeat_is_named_with_its_size(visit, gauges, source) -> None:
    found = [visit(gauges=gauges) for _ in range(60)]
    named = [one for one in found if one.source is source]
    assert len(named) >= 54
    assert np.median([one.excess for one in named]) == pytest.approx(max(gauges), rel=0.2)


@pytest.mark.sample("0.02")
@pytest.mark.parametrize("stops", [0.0, 0.02])
def test_play_moves_the_ball_and_errors_of_encoders_do_not(visit, stops) -> None:
    """Whether the controller stops at the same place or not, neither is taken for the other."""
    for kind, source in (("sliders", ScatterSource.JOINTS), ("encoders", ScatterSource.ENCODERS)):
        found = [visit(stops=stops, **{kind: 0.04}) for _ in range(60)]
        named = [one for one in found if one.source is source]
        assert len(named) >= 56
        assert np.median([one.excess for one in named]) == pytest.approx(0.04, rel=0.15)


def test_one_encoder_is_named(visit) -> None:
    encoders = np.zeros(6)
    encoders[2] = 0.08
    found = Counter(visit(encoders=encoders).source for _ in range(60))
    assert found[ScatterSource.ENCODER_3] >= 45
    assert sum(found.values()) - found[ScatterSource.ENCODER_3] - found[None] <= 2


def test_less_scatter_than_stated_is_no_excess(visit) -> None:
    found = visit(stated=10.0 * NOISE)
    assert found.source is None
    assert found.ratio_at_most < 0.3


def test_two_visits_tell_nothing(visit) -> None:
    assert visit(visits=2) is None
