"""Backlash that was found is no scatter: repeats are compared by where the joints stood."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.problem.random_walk import GaugeWalk
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.pose import Pose
from hexacell.noise.allowances import SIGMAS, Allowances
from procedures.calibration.repeatability import since_zero
from procedures.run.readings import Reading
from procedures.run.set_state import SetState
from tests.benchmarks.worlds.campaigns import setting
from tests.benchmarks.worlds.not_geometry import effect_of, terms_of
from tests.benchmarks.worlds.world import World

BACKLASH = np.full(6, 0.1)
FROM_BELOW, FROM_BOTH_SIDES = (1,) * 6, (1, -1, 1, -1, 1, -1)


def reading(ball: np.ndarray, joints: np.ndarray, directions: tuple[int, ...]) -> Reading:
    return Reading(
        answers=(),
        counts=(),
        skews_s=(),
        gauges_mm=tuple(ball.tolist()),
        spread_mm=(0.0, 0.0, 0.0),
        joints=tuple(joints.tolist()),
        directions=directions,
    )


@pytest.fixture(scope="module")
def allowances() -> Allowances:
    own = setting(0)
    robot = replace(own.robot, terms=terms_of(own.robot))
    world = World(robot, own.truth, effect_of({"backlash": BACKLASH}), 1)
    found = identify(robot.problem(world.records(own.commands, robot.commanding)))
    return Allowances(own.cell.settings, robot, is_measured=True, found=found)


def test_a_reference_reached_from_another_side_is_no_slipped_gauge(allowances: Allowances) -> None:
    reference = Pose(*allowances.settings.identification.points[0])
    ball, encoders = allowances.ball_at(reference), np.zeros(6)
    moved = ball.motion(-0.5 * BACKLASH * (np.array(FROM_BOTH_SIDES) - FROM_BELOW))
    zero = reading(np.zeros(3), encoders, FROM_BELOW)
    at_zero = SetState((SimpleNamespace(reading=zero, pose=reference.as_tuple()),))  # type: ignore[arg-type]
    now = reading(moved, encoders, FROM_BOTH_SIDES)
    with_it, without = (
        np.abs(since_zero(known, at_zero, now).unexplained_mm).max()
        for known in (allowances, replace(allowances, found=None))
    )
    assert without > 0.2
    assert with_it < 0.3 * without
    unknown = since_zero(allowances, at_zero, reading(moved, encoders, (0,) * 6))
    assert np.abs(unknown.unexplained_mm).max() > 0.2
    assert not unknown.exceeds(0.1), "joints of which nobody knows from which side they came"
    slipped = reading(moved + 1.0, encoders, FROM_BOTH_SIDES)
    assert since_zero(allowances, at_zero, slipped).exceeds(0.1)


def test_a_drift_goes_by_the_time_of_the_readings_as_far_as_it_is_known(allowances: Allowances) -> None:
    noise = replace(allowances.robot.noise, walk=GaugeWalk(0.01, 30.0))
    drifting = replace(allowances, robot=replace(allowances.robot, noise=noise))
    zero, pose = reading(np.zeros(3), np.zeros(6), FROM_BELOW), allowances.settings.identification.points[0]

    def readings(known: Allowances, *at_s: float | None) -> float:
        before, now = (zero.model_copy(update={"at_s": one}) for one in at_s)
        taken = (SimpleNamespace(reading=before, pose=pose),) * 11
        return since_zero(known, SetState(taken), now).readings  # type: ignore[arg-type]

    assert [readings(drifting, began_s, 4000.0) for began_s in (3670.0, 400.0, None)] == [11, 120, 11]
    assert readings(allowances, 400.0, 4000.0) == 11, "of an older run it is known how far, by readings"


def test_few_visits_leave_room_for_a_larger_scatter(allowances: Allowances) -> None:
    scattering = replace(allowances.robot, noise=replace(allowances.robot.noise, stops=0.3))
    measured = replace(allowances, robot=scattering)
    assert measured.stop_sigmas > 1.15 * SIGMAS
    assert replace(measured, is_measured=False).stop_sigmas == SIGMAS
    assert measured.following == pytest.approx(measured.stop_sigmas * 0.3)


def test_a_controller_that_corrects_backlash_does_not_scatter(allowances: Allowances) -> None:
    """Its encoders show the way that it makes up for, the ball stays: known from a calibration before."""
    assert allowances.found is not None
    assert allowances.found.terms is not None
    [term] = allowances.found.terms.terms
    mean, sigma = allowances.found.terms.of("backlash")
    lost = replace(term, mean=mean, sigma=sigma)
    corrected = Corrections(backlash=tuple(BACKLASH.tolist()))
    checked = replace(allowances.robot, known_terms=(lost,), corrections=corrected)
    knows = replace(allowances, robot=checked, found=None)
    reference = Pose(*allowances.settings.identification.points[0])
    zero = reading(np.zeros(3), 0.5 * BACKLASH * FROM_BELOW, FROM_BELOW)
    now = reading(np.zeros(3), 0.5 * BACKLASH * FROM_BOTH_SIDES, FROM_BOTH_SIDES)
    at_zero = SetState((SimpleNamespace(reading=zero, pose=reference.as_tuple()),))  # type: ignore[arg-type]
    change = since_zero(knows, at_zero, now)
    assert change.joints == pytest.approx(np.zeros(6), abs=1e-9)
    by_encoders = np.linalg.norm(knows.ball_at(reference).motion(np.array(now.joints)))
    assert np.abs(change.unexplained_mm).max() < 0.3 * by_encoders
