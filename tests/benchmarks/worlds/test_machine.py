"""Worlds without imperfections are the product's robots; those with one differ as closed forms say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.identification.diagnostics.frame_alignment import FrameFit, pose_errors
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import pose_sensitivity
from hexacell.robot.virtual_robot import VirtualRobot
from tests.benchmarks.worlds import frames, legs, rails
from tests.benchmarks.worlds.campaigns import Setting, setting
from tests.benchmarks.worlds.closure import Bodies, close, leg_forces, slider_places
from tests.benchmarks.worlds.effects import Effect, Posture, Shift, Stops
from tests.benchmarks.worlds.encoders import offset, scale
from tests.benchmarks.worlds.kinds import CENTRE, DOWN, KINDS, NONE
from tests.benchmarks.worlds.world import World

NUMBER = 1


@pytest.fixture(scope="module")
def own() -> Setting:
    return setting(NUMBER)


def world(own: Setting, effect: Effect, *, noisy: bool = False, truth: Geometry | None = None) -> World:
    return World(own.robot, truth or own.truth, effect, 5, is_noisy=noisy)


def reached(own: Setting, effect: Effect, truth: Geometry | None = None) -> PoseBatch:
    return world(own, effect, truth=truth).reached(own.commands.poses, own.robot.commanding)


def commanded_joints(own: Setting) -> Array:
    return slider_places(own.robot.commanding, own.robot.branch, own.commands.poses)


def product_poses(own: Setting, joints: Array, ideal: PoseBatch) -> PoseBatch:
    found = continue_solution(own.robot.mechanism, own.truth, joints, start=ideal, start_geometry=own.truth)
    assert found.found.all()
    return found.poses


def difference(one: PoseBatch, other: PoseBatch) -> float:
    return float(np.abs(pose_errors(one, other)).max())


def test_without_effects_the_machine_goes_where_the_product_says(own):
    expected = own.robot.commanded(own.truth).actual_poses(own.commands.poses)
    assert expected.found.all()
    assert difference(reached(own, Effect()), expected.poses) < 1e-8
    assert np.abs(commanded_joints(own) - expected.joints).max() < 1e-9


def test_without_effects_and_noise_records_are_those_of_a_virtual_robot(own):
    noise = replace(own.robot.noise, encoder=0.0, gauge_mm=0.0)
    robot = VirtualRobot(replace(own.robot, noise=noise), own.truth)
    records = world(own, Effect()).records(own.commands, own.robot.commanding).records
    for record in records:
        if record.orientation == 1:
            robot.zero_gauges()
        robot.place(record.pose)
        expected = robot.measure(*record.id)
        assert np.allclose(record.joints, expected.joints, atol=1e-8)
        assert np.allclose(record.deviation, expected.deviation, atol=1e-7)


@pytest.mark.parametrize("name", KINDS)
def test_a_kind_of_size_zero_changes_nothing(own, name):
    effect = KINDS[name].world(0.0, np.random.default_rng(3))
    found, expected = (
        world(own, one).records(own.commands, own.robot.commanding) for one in (effect, Effect())
    )
    assert np.array_equal(found.joints, expected.joints)
    assert np.allclose(found.deviations, expected.deviations, atol=1e-9)


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_changes_something_and_ten_times_as_much_changes_more(own, name):
    before = world(own, Effect()).records(own.commands, own.robot.commanding)

    def change(factor: float) -> float:
        effect = KINDS[name].world(factor, np.random.default_rng(4))
        after = world(own, effect).records(own.commands, own.robot.commanding)
        return float(
            max(
                np.abs(after.deviations - before.deviations).max(),
                np.abs(after.joints - before.joints).max(),
            )
        )

    if name != NONE and "outliers" not in name and "at work" not in name:  # there may be no outlier
        assert 0.0 < change(1.0) < change(10.0)


@pytest.mark.parametrize("name", [name for name in KINDS if "at work" in name])
def test_what_is_only_there_at_work_is_in_no_record_but_in_the_error(own, name):
    changed = world(own, KINDS[name].world(1.0, np.random.default_rng(4)))
    found, expected = (
        one.records(own.commands, own.robot.commanding) for one in (changed, world(own, Effect()))
    )
    assert np.array_equal(found.deviations, expected.deviations)
    assert changed.errors(own.truth, own.task.poses, own.task.workspace).largest_mm > 1e-4


def test_there_are_at_least_sixty_kinds():
    assert len(KINDS) >= 60


def test_encoders_that_show_too_much_bring_sliders_short(own):
    ideal, joints = reached(own, Effect()), commanded_joints(own)
    shares = 1e-4 * np.arange(-2.0, 4.0)
    expected = product_poses(own, joints * (1.0 - shares), ideal)
    assert difference(reached(own, scale(shares)), expected) < 1e-8


def test_zeros_of_encoders_are_a_shift_of_slider_joints(own):
    offsets = 0.1 * np.arange(6.0)
    S = own.truth["S"] - offsets[:, None] * np.array([1.0, 0.0, 0.0])
    moved = Geometry.of(own.truth.parameters, {"S": S, "B": own.truth["B"], "l": own.truth["l"]})
    assert difference(reached(own, offset(offsets)), reached(own, Effect(), moved)) < 1e-8


def test_small_shifts_move_the_platform_as_the_derivatives_of_the_product_say(own):
    random = np.random.default_rng(1)
    sliders, platform = 1e-3 * random.standard_normal((2, 6, 3))
    lengths = 1e-3 * random.standard_normal(6)
    ideal, joints = reached(own, Effect()), commanded_joints(own)
    change = own.truth.parameters.vector({"S": sliders, "B": platform, "l": lengths})
    off = Shift(sliders, platform, lengths)
    linear = pose_sensitivity(own.robot.mechanism, own.truth, ideal, joints).parameters @ change
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
    S = own.truth["S"].copy()
    S[:, 0] += yaw * S[:, 1]
    moved = Geometry.of(own.truth.parameters, {"S": S, "B": own.truth["B"], "l": own.truth["l"]})
    expected = reached(own, Effect(), moved)
    turned = PoseBatch(expected.positions @ turn.T, turn @ expected.rotations)
    assert difference(found, turned) < 1e-4  # of second order


def test_a_sag_is_deepest_in_the_middle_and_nothing_at_the_ends(own):
    places = np.array([[-800.0, 0.0, 800.0, 400.0, 0.0, -400.0]])
    posture = _standing(own, places)
    down = rails.sagging(0.05 * np.ones(6)).shift(_stops(places), posture).sliders
    assert isinstance(down, np.ndarray)
    assert np.allclose(down[0, :, 2], [0.0, -0.05, 0.0, -0.0375, -0.05, -0.0375])
    assert not down[..., :2].any()


def test_a_wave_repeats_after_its_length_and_has_its_amplitude(own):
    places = np.linspace(-300.0, 300.0, 601)[:, None] * np.ones(6)
    wave = rails.wavy(0.01, 150.0, np.array([0.0, 1.0, 0.0]), np.zeros((6, 3)))
    shift = wave.shift(_stops(places), _standing(own, places)).sliders
    assert isinstance(shift, np.ndarray)
    assert np.allclose(shift[:451], shift[150:], atol=1e-12)
    assert np.abs(shift[..., 1]).max() == pytest.approx(0.01, rel=1e-3)
    assert not shift[..., [0, 2]].any()


def _stops(places: Array) -> Stops:
    return Stops.of(np.zeros(len(places), dtype=np.intp), places, 0.0, (1,))


def _standing(own: Setting, places: Array) -> Posture:
    """With slider joints at some places along their rails."""
    bodies = Bodies.of(own.truth, places - own.truth["S"][:, 0])
    level = PoseBatch(np.zeros((len(places), 3)), np.broadcast_to(np.eye(3), (len(places), 3, 3)))
    return Posture(places, bodies, level)


def test_forces_in_legs_balance_the_weight(own):
    poses, bodies = reached(own, Effect()), Bodies.of(own.truth, commanded_joints(own))
    forces = leg_forces(bodies, poses, 20.0 * DOWN, CENTRE)
    toward, _ = bodies.directions(poses)
    assert np.allclose(np.einsum("nl,nli->ni", forces, toward), -20.0 * DOWN, atol=1e-9)
    moments = np.cross(bodies.arms(poses), toward)
    load = np.cross(poses.rotations @ CENTRE, 20.0 * DOWN)
    assert np.allclose(np.einsum("nl,nli->ni", forces, moments), -load, atol=1e-7)


def test_forces_in_legs_follow_from_virtual_work(own):
    poses, bodies = reached(own, Effect()), Bodies.of(own.truth, commanded_joints(own))
    forces = leg_forces(bodies, poses, 20.0 * DOWN, CENTRE)
    for leg in range(6):
        step = 1e-5 * (np.arange(6) == leg)
        longer = close(replace(bodies, lengths=bodies.lengths + step), poses)
        lifted = (longer.positions + longer.rotations @ CENTRE) - (
            poses.positions + poses.rotations @ CENTRE
        )
        # What the weight gains is what the leg, growing against its tension, takes.
        assert np.allclose(lifted @ (20.0 * DOWN), 1e-5 * forces[:, leg], rtol=1e-3, atol=1e-7)


def test_elastic_legs_are_longer_by_their_pull(own):
    poses, joints = reached(own, Effect()), commanded_joints(own)
    bodies = Bodies.of(own.truth, joints)
    pull = leg_forces(bodies, poses, 20.0 * DOWN, CENTRE)
    shift = legs.elastic(1e-5 * np.ones(6), 20.0 * DOWN, CENTRE).shift(
        _stops(joints), Posture(joints, bodies, poses)
    )
    assert np.allclose(shift.lengths, 1e-5 * pull)


def test_sliders_that_do_not_repeat_scatter_the_platform_as_the_derivatives_say(own):
    sigma = 0.002
    visits = world(own, rails.stopping(sigma, np.array([1.0, 0.0, 0.0])))
    task, workspace = own.task.poses, own.task.workspace
    errors = visits.errors(own.truth, task, workspace)
    joints = slider_places(own.truth, own.robot.branch, task)
    by_joints = pose_sensitivity(own.robot.mechanism, own.truth, task, joints).joints[:, :3]
    expected = sigma * np.sqrt(np.sum(by_joints**2, axis=(1, 2)))
    assert np.allclose(errors.scatter, expected, rtol=0.35)
    assert errors.largest_mm < 0.5 * expected.max()


def test_a_known_geometry_without_effects_has_no_error_in_whatever_frames(own):
    turn = Rotation.from_rotvec([1e-3, -2e-3, 3e-3]).as_matrix()
    B = own.truth["B"] @ turn.T
    S = own.truth["S"] + np.array([1.0, -2.0, 3.0])
    written = Geometry.of(own.truth.parameters, {"S": S, "B": B, "l": own.truth["l"]})
    errors = world(own, Effect()).errors(written, own.task.poses, own.task.workspace)
    # Other frames mean other joint variables, but of a machine that is known exactly.
    assert errors.largest_mm < 1e-6


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
