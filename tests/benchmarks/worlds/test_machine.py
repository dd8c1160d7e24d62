"""Worlds without imperfections are the product's robots; those with one differ as closed forms say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.identification.diagnostics.frame_alignment import FrameFit, pose_errors
from hexacell.identification.placement import Placement
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, skew
from hexacell.kinematics.sensitivity import free_sensitivity
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.virtual_robot import VirtualRobot
from tests.benchmarks.worlds import encoders, frames, gauges, legs, rails
from tests.benchmarks.worlds.campaigns import Setting, setting
from tests.benchmarks.worlds.closure import Bodies, close, leg_forces, slider_places
from tests.benchmarks.worlds.effects import RECORD_HOURS, Effect, Shift, Stops, at_once
from tests.benchmarks.worlds.kinds import CENTRE, DOWN, EVERY, KINDS, NONE, STATED_MM
from tests.benchmarks.worlds.world import World

MOVED = np.random.default_rng(1).uniform(-3.0, 3.0, (40, 3))
X = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def own() -> Setting:
    return setting(1)


def world(own: Setting, effect: Effect, truth: Geometry | None = None) -> World:
    return World(own.robot, truth or own.truth, effect, 5, is_noisy=False)


def reached(own: Setting, effect: Effect, truth: Geometry | None = None) -> PoseBatch:
    return world(own, effect, truth).reached(own.commands.poses, own.robot.commanding)


def records(own: Setting, effect: Effect) -> MeasurementSet:
    return world(own, effect).records(own.commands, own.robot.commanding)


def commanded_joints(own: Setting) -> Array:
    return slider_places(own.robot.commanding, own.robot.branch, own.commands.poses)


def with_sliders(own: Setting, S: Array) -> Geometry:
    """The geometry without effects, but for its slider joints."""
    return Geometry.of(own.truth.parameters, {"S": S, "B": own.truth["B"], "l": own.truth["l"]})


def difference(one: PoseBatch, other: PoseBatch) -> float:
    return float(np.abs(pose_errors(one, other)).max())


def stops(points: int = 2, count: int = 40) -> Stops:
    """At random places."""
    joints = np.random.default_rng(1).uniform(-400.0, 400.0, (count, 6))
    return Stops.of(np.repeat(np.arange(points), count // points), joints, 0.0, (1,))


def test_without_effects_the_machine_goes_where_the_product_says(own):
    expected = own.robot.commanded(own.truth).actual_poses(own.commands.poses)
    assert expected.found.all()
    assert difference(reached(own, Effect()), expected.poses) < 1e-8
    assert np.abs(commanded_joints(own) - expected.joints).max() < 1e-9


def test_without_effects_and_noise_records_are_those_of_a_virtual_robot(own):
    noise = replace(own.robot.noise, encoder=0.0, gauge_mm=0.0)
    robot = VirtualRobot(replace(own.robot, noise=noise), own.truth)
    for record in records(own, Effect()).records:
        if record.orientation == 1:
            robot.zero_gauges()
        robot.place(record.pose)
        expected = robot.measure(*record.id)
        assert np.allclose(record.joints, expected.joints, atol=1e-8)
        assert np.allclose(record.deviation, expected.deviation, atol=1e-7)


@pytest.mark.parametrize("name", [name for name in KINDS if name != NONE])
def test_a_kind_changes_nothing_at_size_zero_and_more_the_larger_it_is(own, name):
    expected = records(own, Effect())

    def change(factor: float) -> float:
        found = records(own, KINDS[name].world(factor, np.random.default_rng(4)))
        shown = np.abs(found.deviations - expected.deviations).max()
        return float(max(shown, np.abs(found.joints - expected.joints).max()))

    assert change(0.0) < 1e-9
    if "at work" in name:
        assert change(1.0) == 0.0
        working = world(own, KINDS[name].world(1.0, np.random.default_rng(4)))
        assert working.errors(own.truth, own.task.poses, own.task.workspace).largest_mm > 1e-4
    elif "outliers" not in name:  # there may be no outlier
        assert 0.0 < change(1.0) < change(10.0)


def test_encoders_that_show_too_much_bring_sliders_short(own):
    shares = 1e-4 * np.arange(-2.0, 4.0)
    found = continue_solution(
        own.robot.mechanism,
        own.truth,
        commanded_joints(own) * (1.0 - shares),
        start=reached(own, Effect()),
        start_geometry=own.truth,
    )
    assert found.found.all()
    assert difference(reached(own, encoders.scale(shares)), found.poses) < 1e-8


def test_small_shifts_move_the_platform_as_the_derivatives_of_the_product_say(own):
    random = np.random.default_rng(1)
    sliders, platform = 1e-3 * random.standard_normal((2, 6, 3))
    lengths = 1e-3 * random.standard_normal(6)
    ideal, joints = reached(own, Effect()), commanded_joints(own)
    change = own.truth.parameters.vector({"S": sliders, "B": platform, "l": lengths})
    off = Shift(sliders, platform, lengths)
    placed = Placement(own.robot.mechanism, own.truth, ideal, joints)
    linear = placed.by_parameters(change[:, None])[..., 0]
    found = pose_errors(reached(own, Effect(shift=lambda *_: off)), ideal)
    assert np.abs(found - linear).max() < 2e-2 * np.abs(linear).max()


def test_a_machine_that_grows_as_a_whole_goes_as_far_too_far(own):
    share = 1e-4
    found = reached(own, legs.warm(share * np.ones(6), share, share, share))
    expected = reached(own, Effect())
    assert np.allclose(found.positions, (1.0 + share) * expected.positions, atol=1e-4)  # of second order
    assert np.allclose(found.rotations, expected.rotations, atol=1e-6)


def test_rails_that_all_lead_aside_are_a_turned_machine(own):
    yaw = 1e-4
    found = reached(own, rails.not_parallel(yaw * np.ones(6), np.zeros(6)))
    turn = Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix()
    # Turned back, slider joints are where they were but for x, which then depends on y.
    moved = with_sliders(own, own.truth["S"] + yaw * own.truth["S"][:, 1:2] * X)
    expected = reached(own, Effect(), moved)
    turned = PoseBatch(expected.positions @ turn.T, turn @ expected.rotations)
    assert difference(found, turned) < 1e-4  # of second order


def test_forces_in_legs_balance_the_weight_and_do_its_work(own):
    poses, bodies = reached(own, Effect()), Bodies.of(own.truth, commanded_joints(own))
    forces = leg_forces(bodies, poses, 20.0 * DOWN, CENTRE)
    toward, _ = bodies.directions(poses)
    assert np.allclose(np.einsum("nl,nli->ni", forces, toward), -20.0 * DOWN, atol=1e-9)
    moments = np.cross(bodies.arms(poses), toward)
    load = np.cross(poses.rotations @ CENTRE, 20.0 * DOWN)
    assert np.allclose(np.einsum("nl,nli->ni", forces, moments), -load, atol=1e-7)
    for leg in range(6):
        longer = close(replace(bodies, lengths=bodies.lengths + 1e-5 * (np.arange(6) == leg)), poses)
        lifted = longer.positions - poses.positions + (longer.rotations - poses.rotations) @ CENTRE
        # What the weight gains is what the leg, growing against its tension, takes.
        assert np.allclose(lifted @ (20.0 * DOWN), 1e-5 * forces[:, leg], rtol=1e-3, atol=1e-7)


def test_sliders_that_do_not_repeat_scatter_the_platform_as_the_derivatives_say(own):
    sigma, task = 0.002, own.task.poses
    errors = world(own, rails.stopping(sigma, X)).errors(own.truth, task, own.task.workspace)
    joints = slider_places(own.truth, own.robot.branch, task)
    by_joints = free_sensitivity(own.robot.mechanism, own.truth, task, joints).joints[:, :3]
    expected = sigma * np.sqrt(np.sum(by_joints**2, axis=(1, 2)))
    assert np.allclose(errors.scatter, expected, rtol=0.35)
    assert errors.largest_mm < 0.5 * expected.max()


def test_best_frames_are_those_of_the_product(own):
    random = np.random.default_rng(2)
    workspace, length = own.task.workspace, 150.0
    wrong = random.standard_normal((2, len(workspace), 3)) * np.array([[[0.3]], [[2e-3]]])
    turned = Rotation.from_rotvec(wrong[1]).as_matrix() @ workspace.rotations
    off = frames.moved(
        PoseBatch(workspace.positions + wrong[0], turned), np.array([1, 2, -3, 50, 20, 10, 4, -2, 1]) * 1e-2
    )
    found = frames.moved(off, frames.best_frames(off, workspace, length))
    expected = FrameFit(workspace, length).aligned(off, off)
    assert difference(found, expected) < 1e-4
    assert np.abs(pose_errors(off, workspace)).max() > 0.1


def test_a_turned_triad_shows_the_displacement_in_its_own_axes():
    vector = np.array([1e-3, -2e-3, 5e-4])
    seen = MOVED @ Rotation.from_rotvec(vector).as_matrix()  # R^T d for each row
    error = gauges.linear(-skew(vector)[None]).gauge_error(stops(), MOVED)
    assert np.allclose(MOVED + error, seen, atol=3 * 4e-6)


def test_a_ball_out_of_round_is_an_ellipsoid_to_first_order():
    size, axis, radius = 0.002, np.array([0.6, 0.0, 0.8]), 10.0
    rotations = Rotation.random(40, rng=np.random.default_rng(3)).as_matrix()
    cosine = rotations @ axis
    support = np.sqrt(((radius + size) * cosine) ** 2 + (radius - size / 2) ** 2 * (1 - cosine**2))
    found = gauges.out_of_round(size, axis, 2).ball(stops(), rotations)
    assert np.allclose(found, support - radius, atol=2e-6)


def test_stands_drift_and_are_pushed_until_they_are_placed_anew():
    drift = gauges.drifting(np.array([[0.01, 0.0, 0.0], [0.0, 0.02, 0.0]])).gauge_error(stops(), MOVED)
    hours = RECORD_HOURS * np.arange(20)
    assert np.allclose(drift[:20, 0], 0.01 * hours)
    assert np.allclose(drift[20:, 1], 0.02 * hours)
    pushed = gauges.jump(np.array([0.1, 0.2, 0.3]), 7.5 * RECORD_HOURS).gauge_error(stops(), MOVED)
    assert np.allclose(pushed[7:20], [0.1, 0.2, 0.3])
    assert not pushed[:7].any()
    assert not pushed[20:].any()


@pytest.mark.parametrize("name", ["gauges noisier", "gauges, long tails"])
def test_noise_is_as_many_times_the_stated_one(name):
    effect = KINDS[name].world(5.0, np.random.default_rng(1))  # 1 + 5 * 0.2 times the stated noise
    more = effect.gauge_error(stops(1, 40_000), np.zeros((40_000, 3)))
    assert np.hypot(np.std(more), STATED_MM) == pytest.approx(2.0 * STATED_MM, rel=0.05)


def test_what_is_random_is_the_same_when_asked_twice_and_another_for_each_effect():
    noise = gauges.more_noise(EVERY)
    both = at_once(noise, noise).gauge_error(stops(), MOVED)
    assert np.array_equal(noise.gauge_error(stops(), MOVED), noise.gauge_error(stops(), MOVED))
    parts = [noise.gauge_error(stops().of_effect(number), MOVED) for number in (0, 1)]
    assert np.array_equal(both, parts[0] + parts[1])
    assert not np.array_equal(parts[0], parts[1])
