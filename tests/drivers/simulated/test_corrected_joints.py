"""The simulated controller sends what its config says for backlash, play and compliance."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.simulated.imperfections import LoadedMachine
from drivers.simulated.robot import directions_on, with_longer_legs
from hexacell.cell.loader import load_cell
from hexacell.cell.simulation import SimulatedLegs, SimulatedLoad
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import controller_geometry
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion.trajectory import interpolate_line
from tests.cli.cell_folder import CONFIGS
from tests.native_config import NATIVE

POSES = (
    Pose(5.0, -3.0, 548.0, 6.0, -4.0, 2.0),
    Pose(-8.0, 4.0, 552.0, -5.0, 9.0, -3.0),
    Pose(6.0, 7.0, 545.0, 12.0, 3.0, 8.0),
    Pose(5.0, -3.0, 548.0, 6.0, -4.0, 2.0),
)
LAGGING = Corrections(backlash=(0.1, 0.08, 0.12, 0.1, 0.0, 0.09))
YIELDING = Corrections(
    play_mm=(0.1, 0.08, 0.12, 0.1, 0.05, 0.09),
    compliance_um_n=(0.3, 0.36, 0.3, 0.24, 0.3, 0.3),
    weight_n=100.0,
    weight_centre_mm=(3.0, -20.0, 40.0),
)


def correct(twin: Any, corrections: Corrections) -> None:
    """The controller gets the true geometry, and these corrections."""
    [text] = NATIVE.rewrite([twin.config.read_text()], twin.truth, corrections)
    twin.config.write_text(text)
    twin.machine.switch_on()


def ball(twin: Any) -> Any:
    twin.seen()
    return twin.physics._pose.positions[0]


def off(twin: Any, poses: tuple[Pose, ...] = POSES) -> list[float]:
    """How far the ball is from where it was commanded, mm, at each pose."""
    found = []
    for pose in poses:
        twin.go(pose)
        found.append(float(np.linalg.norm(ball(twin) - pose.position)))
        assert twin.machine.pose().as_tuple() == pytest.approx(pose.as_tuple(), abs=1e-9)
        config, poses_of = NATIVE.read(twin.config), PoseBatch.of([pose])
        own = inverse_kinematics(Hexaglide(), twin.truth, config.branch, poses_of)
        commanded = with_longer_legs(Hexaglide(), config, poses_of, own)[0]
        assert twin.machine.joints() == pytest.approx(commanded, abs=1e-5), "with what legs need"
    return found


def test_backlash_play_and_compliance_of_the_machine_are_made_good(make_twin) -> None:
    every = replace(YIELDING, backlash=LAGGING.backlash)
    twin = make_twin(
        joints__backlash_mm=every.backlash,
        legs__play_mm=every.play_mm,
        legs__compliance_um_n=every.compliance_um_n,
        load__weight_n=every.weight_n,
        load__centre_mm=every.weight_centre_mm,
    )
    correct(twin, Corrections())
    assert min(off(twin)) > 0.05
    correct(twin, every)
    # It stands at the first pose: a joint has its side only once it has moved.
    assert max(off(twin, POSES[1:])) < 1e-4


def directions(twin: Any, start: Pose, end: Pose, share: float) -> Any:
    """In which direction the joints move where a share of a straight line is done."""
    places = interpolate_line(PoseBatch.of([start]), PoseBatch.of([end]), 1000)
    row = round(1000 * share)
    branch = NATIVE.read(twin.config).branch
    own = inverse_kinematics(Hexaglide(), twin.truth, branch, places[[row - 1, row]])
    return np.sign(own[1] - own[0])


def test_a_joint_is_sent_half_of_its_backlash_further_in_the_direction_of_its_motion(make_twin) -> None:
    twin, half = make_twin(), 0.5 * np.array(LAGGING.backlash)
    correct(twin, LAGGING)
    before = twin.machine.pose()
    for pose in POSES:
        twin.go(pose)
        sent, reported = twin.physics.encoder_positions(), np.array(twin.machine.joints())
        assert sent - reported == pytest.approx(half * directions(twin, before, pose, 1.0), abs=1e-9)
        before = pose
    twin.go(POSES[-1])
    assert twin.physics.encoder_positions() == pytest.approx(sent, abs=1e-6), "standing, it keeps its side"


def test_stopped_in_a_move_a_joint_has_the_direction_of_that_move(make_twin) -> None:
    twin, half = make_twin(), 0.5 * np.array(LAGGING.backlash)
    correct(twin, LAGGING)
    twin.go(POSES[0])

    def stop_half_way() -> None:
        twin.clock.time_s += 0.5 * twin.physics._motion.duration_s
        twin.machine.stop()

    twin.clock.on_wait = stop_half_way
    twin.machine.move(POSES[1])
    added = twin.physics.encoder_positions() - twin.machine.joints()
    assert added == pytest.approx(half * directions(twin, POSES[0], POSES[1], 0.5), abs=1e-6)


def test_corrections_that_are_read_move_nothing_until_the_next_motion(make_twin) -> None:
    twin = make_twin()
    correct(twin, LAGGING)
    twin.go(POSES[0])
    sent, reported = twin.physics.encoder_positions(), twin.machine.joints()
    correct(twin, replace(YIELDING, backlash=LAGGING.backlash))
    assert np.array_equal(twin.physics.encoder_positions(), sent)
    assert twin.machine.joints() == pytest.approx(reported, abs=1e-6)
    twin.go(POSES[0])
    branch = NATIVE.read(twin.config).branch
    controller = ControllerGeometry(twin.truth, branch, corrections=YIELDING)
    legs = with_longer_legs(Hexaglide(), controller, PoseBatch.of([POSES[0]]), np.array([reported]))[0]
    kept = sent - reported
    # By the legs alone: each joint that goes on in its direction keeps it.
    goes_on = np.sign(legs - reported) == np.sign(kept)
    moved = twin.physics.encoder_positions() - sent
    assert moved[goes_on] == pytest.approx((legs - reported)[goes_on], abs=1e-6)


def test_corrections_of_zero_change_no_bit(make_twin) -> None:
    def places(text: str) -> list[Any]:
        twin = make_twin()
        twin.config.write_text(twin.config.read_text() + text)
        twin.machine.switch_on()
        found = []
        for pose in POSES:
            twin.go(pose)
            found += [*twin.physics.encoder_positions(), *twin.machine.joints()]
            found += twin.machine.pose().as_tuple()
        return found

    assert places("") == places("\n[corrections]\nweight_n = 100.0\n")


def test_a_joint_that_stands_keeps_its_direction() -> None:
    path = np.array([[0.0] * 6, [1.0, -1.0, 0.0, 1e-12, 1.0, 0.0], [1.0, -2.0, 0.0, 0.0, 0.5, -1.0]])
    before = np.array([0.0, 0.0, 1.0, -1.0, 0.0, 0.0])
    assert directions_on(path, before)[1:].tolist() == [[1, -1, 1, -1, 1, 0], [1, -1, 1, -1, -1, -1]]


@pytest.mark.parametrize(
    "name", ["simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks", "camera-hexapod"]
)
def test_legs_of_every_mechanism_close_under_load_at_the_commanded_pose(name: str) -> None:
    """The machine itself finds its lengths under load, and the pose with them, by the simulated physics."""
    cell = load_cell(CONFIGS / f"{name}.toml")
    simulation, mechanism = cell.settings.simulation, cell.settings.mechanism
    assert simulation is not None
    controller = replace(controller_geometry(cell), corrections=YIELDING)
    legs = SimulatedLegs(play_mm=YIELDING.play_mm, compliance_um_n=YIELDING.compliance_um_n)
    load = SimulatedLoad(weight_n=100.0, centre_mm=YIELDING.weight_centre_mm)
    machine = LoadedMachine(
        mechanism, controller.geometry, simulation.model_copy(update={"legs": legs, "load": load})
    )
    x, y, z = cell.settings.identification.points[0]
    poses = PoseBatch.of([Pose(x, y, z, 4.0, -3.0, 2.0)])
    joints = mechanism.inverse(controller.geometry, controller.branch, poses)
    sent = with_longer_legs(mechanism, controller, poses, joints)
    for wanted, least in ((joints, 0.01), (sent, 0.0)):
        found = machine.pose(wanted[0], 0.0, poses)
        assert found.found[0]
        distance = float(np.linalg.norm(found.poses.positions - poses.positions))
        assert least <= distance < max(1e-4, 1e3 * least)


def test_a_pose_out_of_reach_stays_so() -> None:
    config = CONFIGS / "simulated-hexaglide.controller.toml"
    controller = replace(NATIVE.read(config), corrections=YIELDING)
    poses = PoseBatch.of([POSES[0], Pose(0.0, 0.0, 2000.0)])
    joints = Hexaglide().inverse(controller.geometry, controller.branch, poses)
    sent = with_longer_legs(Hexaglide(), controller, poses, joints)
    assert np.isnan(sent).any(axis=1).tolist() == [False, True]
    assert 0.005 < np.abs(sent[0] - joints[0]).max() < 0.5
