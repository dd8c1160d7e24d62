"""Backlash, play, compliance and expansion of a simulated machine, against truths in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.simulated import imperfections
from drivers.simulated.physics import RobotPhysics
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.simulation import SimulatedLoad
from hexacell.config.toml_format import native_layout
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS, GoughStewart
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from tests.drivers.simulated.conftest import STILL, StillClock, changed

CELLS = ("simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks")
COMPLIANCE = (0.1, 0.3, 0.2, 0.25, 0.15, 0.35)
PLAY = (0.02, 0.05, 0.03, 0.04, 0.06, 0.01)


def in_unit(key: str, unit: str) -> str:
    """A key of the cell file where joints have that unit, by what it is where they slide."""
    is_of_joints = key.startswith("encoders.") or key.endswith(("backlash_mm", "repeatability_mm"))
    return f"{key.removesuffix('_mm')}_{unit}" if is_of_joints and key.endswith("_mm") else key


class Machine:
    """The machine of a bundled cell at some of its poses, with changes of its simulation."""

    def __init__(self, name: str, **changes: Any) -> None:
        cell = load_cell(bundled_config(name))
        assert cell.settings.simulation is not None
        self.mechanism = cell.settings.mechanism
        unit = self.mechanism.words.joint_unit
        keys = {in_unit(key.replace("__", "."), unit): value for key, value in changes.items()}
        self.settings = changed(cell.settings.simulation, keys)
        parameters = self.mechanism.parameters
        self.geometry = Geometry.of(parameters, self.settings.geometry.model_dump())
        self.commanding = native_layout(parameters).read(cell.config_path)
        self.home = Pose(*cell.settings.identification.points[0])
        poses = [
            Pose(*(np.array(self.home.as_tuple()) + off))
            for off in (
                [0.0] * 6,
                [20.0, -30.0, 10.0, 5.0, -4.0, 6.0],
                [-40.0, 10.0, -20.0, -8.0, 6.0, 3.0],
            )
        ]
        self.poses = PoseBatch.of(poses)
        self.joints = self.mechanism.inverse(self.geometry, self.commanding.branch, self.poses)

    def loaded(self, row: int, warmer_k: float = 0.0) -> PoseBatch:
        """Where the platform is with the joints that would bring it to a pose without imperfections."""
        machine = imperfections.LoadedMachine(self.mechanism, self.geometry, self.settings)
        found = machine.pose(self.joints[row], warmer_k, self.poses[[row]])
        assert found.found[0]
        return found.poses

    def physics(self) -> RobotPhysics:
        return RobotPhysics(self.mechanism, self.settings, StillClock(), self.commanding, self.home)

    def weight(self, row: int, load: SimulatedLoad) -> tuple[Array, Array]:
        """The force, N, and the place in the platform at which it acts at a pose, mm."""
        at_joints = (
            self.mechanism.legs(self.geometry, self.poses, self.joints).platform_joints[row].mean(axis=0)
        )
        middle = self.poses.rotations[row].T @ (at_joints - self.poses.positions[row])
        force = load.weight_n * np.array(load.direction) / np.linalg.norm(load.direction)
        return force, middle if load.centre_mm is None else np.array(load.centre_mm)

    def work(self, row: int, poses: PoseBatch, load: SimulatedLoad) -> float:
        """What the weight does on the way from a pose to another, N mm: above 0 if it sinks."""
        force, centre = self.weight(row, load)
        before = self.poses.positions[row] + self.poses.rotations[row] @ centre
        return float(force @ (poses.positions[0] + poses.rotations[0] @ centre - before))


@pytest.fixture(params=CELLS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_without_imperfections_the_pose_is_that_of_the_geometry(name: str) -> None:
    machine = Machine(name)
    start = machine.poses[[0]]
    for row in range(len(machine.poses)):
        exact = forward_kinematics(machine.mechanism, machine.geometry, machine.joints[[row]], start).poses
        seen = imperfections.LoadedMachine(machine.mechanism, machine.geometry, machine.settings).pose(
            machine.joints[row], 0.0, start
        )
        assert np.array_equal(seen.poses.positions, exact.positions)
        assert np.array_equal(seen.poses.rotations, exact.rotations)
        backlash = imperfections.Backlash(np.zeros(6), machine.joints[0], np.random.default_rng(1))
        assert np.array_equal(backlash.follow(machine.joints[row]), machine.joints[row])


ASLANT = SimulatedLoad(weight_n=80.0, centre_mm=(60.0, -40.0, 20.0), direction=(0.5, 0.2, -3.0))


@pytest.mark.parametrize("load", [SimulatedLoad(weight_n=80.0), ASLANT])
def test_legs_are_in_balance_with_the_weight(name: str, load: SimulatedLoad) -> None:
    """Forces, moments about the base's origin, and virtual work: lengths times forces are its work."""
    machine = Machine(name)
    mechanism, geometry, poses, joints = machine.mechanism, machine.geometry, machine.poses, machine.joints
    tensions = imperfections.leg_tensions(mechanism, geometry, poses, joints, load)
    legs = mechanism.legs(geometry, poses, joints)
    for row in range(len(poses)):
        ends = legs.platform_joints[row]
        along = legs.base_joints[row] - ends
        pulls = tensions[row][:, None] * along / np.linalg.norm(along, axis=1)[:, None]
        force, centre = machine.weight(row, load)
        assert pulls.sum(axis=0) == pytest.approx(-force, abs=1e-8)
        of_weight = np.cross(poses.positions[row] + poses.rotations[row] @ centre, force)
        assert np.cross(ends, pulls).sum(axis=0) == pytest.approx(-of_weight, abs=1e-5)
        for leg in range(6):
            changes = imperfections.with_longer_legs(
                mechanism, geometry, joints[[row]], poses[[row]], 1e-3 * np.eye(6)[leg]
            )
            longer = forward_kinematics(mechanism, *changes, poses[[row]]).poses
            assert tensions[row, leg] * 1e-3 == pytest.approx(machine.work(row, longer, load), abs=1e-4)


def test_legs_yield_by_their_forces_and_the_weight_sinks(name: str) -> None:
    """The work of the weight is that of the springs, twice their energy (Castigliano)."""
    machine = Machine(name, legs__compliance_um_n=COMPLIANCE, load__weight_n=100.0)
    mechanism, geometry = machine.mechanism, machine.geometry
    for row in range(len(machine.poses)):
        poses, joints = machine.loaded(row), machine.joints[[row]]
        tensions = imperfections.leg_tensions(mechanism, geometry, poses, joints, machine.settings.load)[0]
        assert longer_by(machine, row, poses) == pytest.approx(
            1e-3 * np.array(COMPLIANCE) * tensions, abs=1e-8
        )
        work = machine.work(row, poses, machine.settings.load)
        assert work > 0.0
        assert work == pytest.approx(float(1e-3 * np.array(COMPLIANCE) @ tensions**2), rel=0.01)


@pytest.mark.parametrize("weight_n", [2.0, 100.0])
def test_legs_with_play_lie_at_the_end_to_which_the_weight_brings_them(name: str, weight_n: float) -> None:
    """Where their forces are small they lie between the ends, and the weight sinks all the same."""
    machine = Machine(name, legs__play_mm=PLAY, load__weight_n=weight_n, load__centre_mm=(60.0, -40.0, 0.0))
    for row in range(len(machine.poses)):
        poses, joints = machine.loaded(row), machine.joints[[row]]
        load = machine.settings.load
        tensions = imperfections.leg_tensions(machine.mechanism, machine.geometry, poses, joints, load)[0]
        seated = np.interp(tensions, [-imperfections.SEATED_N, imperfections.SEATED_N], [-1.0, 1.0])
        longer = longer_by(machine, row, poses)
        assert longer == pytest.approx(0.5 * np.array(PLAY) * seated, abs=1e-7)
        assert machine.work(row, poses, load) > 0.0


def longer_by(machine: Machine, row: int, poses: PoseBatch) -> Array:
    """By how much the legs (6,) are longer than at the pose without imperfections: joints stay, mm."""
    mechanism, joints = machine.mechanism, machine.joints[[row]]
    both = [mechanism.legs(machine.geometry, one, joints) for one in (machine.poses[[row]], poses)]
    before, after = (np.linalg.norm(legs.base_joints - legs.platform_joints, axis=-1)[0] for legs in both)
    if machine.mechanism.name == "gough-stewart":
        return np.asarray(after - machine.geometry["offset"] - joints[0])
    return np.asarray(after - before)


def test_a_mechanism_without_lengths_does_the_same_by_its_joints() -> None:
    class NoLengths(GoughStewart):
        kinds = GOUGH_STEWART_PARAMETERS.kinds
        parameters = ParameterSet(
            (*kinds[:2], *(_of_no_part(kind) for kind in kinds[2:])), has_branch=False
        )

    machine = Machine(
        "gough-stewart", legs__compliance_um_n=COMPLIANCE, legs__play_mm=PLAY, load__weight_n=50.0
    )
    expected = machine.loaded(1).positions
    machine.mechanism = NoLengths()
    machine.geometry = Geometry(NoLengths.parameters, machine.geometry.vector)
    assert machine.loaded(1).positions == pytest.approx(expected, abs=1e-8)
    assert np.linalg.norm(expected - machine.poses.positions[1]) > 1e-3


def _of_no_part(kind: Any) -> Any:
    return replace(kind, part=None)


def test_a_machine_that_grows_evenly_is_the_same_machine_in_large(name: str) -> None:
    """With the scales of linear encoders; angles stay."""
    machine = Machine(name, temperature__rise_k=3.0)
    for row in range(len(machine.poses)):
        warm, pose = machine.loaded(row, warmer_k=100.0), machine.poses[[row]]
        assert warm.positions == pytest.approx(pose.positions * (1.0 + 100.0 * 11.5e-6), abs=1e-6)
        assert warm.rotations == pytest.approx(pose.rotations, abs=1e-9)


def test_legs_grow_by_their_shares_of_the_rise() -> None:
    shares = (1.0, 2.0, 0.5, 0.0, 1.5, 3.0)
    alone = {"temperature.expansion_base_um_m_k": 0.0, "temperature.expansion_platform_um_m_k": 0.0}
    machine = Machine("simulated-hexaglide", **alone, **{"temperature.legs_share": shares})
    warm, pose = machine.loaded(1, warmer_k=10.0), machine.poses[[1]]
    vector = machine.geometry.vector.copy()
    vector[machine.geometry.parameters.slices["l"]] *= 1.0 + 10.0 * 11.5e-6 * np.array(shares)
    grown = Geometry(machine.geometry.parameters, vector)
    expected = forward_kinematics(machine.mechanism, grown, machine.joints[[1]], pose).poses
    assert warm.positions == pytest.approx(expected.positions, abs=1e-8)


def test_a_cell_becomes_warmer_evenly_from_its_start_and_then_stays_so() -> None:
    rising = {"temperature.rise_k": 4.0, "temperature.over_s": 1000.0, "station_reach_mm": 1e6}
    machine = Machine("linapod", **STILL | rising)
    physics = machine.physics()
    clock: Any = physics._clock
    heights = []
    for _ in range(5):
        heights.append(physics.gauge_displacement("z"))
        clock.time_s += 500.0
    grown = 1e-6 * 11.5 * physics._pose.positions[0, 2] * np.array([0.0, 2.0, 4.0, 4.0, 4.0])
    # The rigid machine as commanded is not quite where its height is exactly proportional.
    assert np.array(heights) - heights[0] == pytest.approx(grown, rel=1e-3)


@pytest.mark.parametrize("name", ["linapod", "rotary-cranks"])
def test_a_joint_that_comes_from_either_side_is_apart_by_its_backlash(name: str) -> None:
    gaps = np.array([0.1, 0.02, 0.05, 0.0, 0.2, 0.08])
    machine = Machine(name, **STILL | {"joints.backlash_mm": tuple(gaps), "station_reach_mm": 1e6})
    physics = machine.physics()
    clock: Any = physics._clock
    there = physics._motion.path[0]

    def ball(*ways: float) -> Array:
        path = there + np.array([0.0, *ways])[:, None] * np.ones(6)
        path[0] = physics.encoder_positions()
        physics.start_motion(path)
        clock.time_s += 100.0
        assert physics.encoder_positions() == pytest.approx(path[-1], abs=1e-9)
        physics.gauge_displacement("x")
        return np.asarray(physics._pose.positions[0])

    start = PoseBatch(physics._pose.positions, physics._pose.rotations)
    for side, ways in ((1.0, (-5.0, 0.0)), (-1.0, (5.0, 0.0)), (1.0, (3.0, -4.0, 0.0))):
        joints = there - 0.5 * side * gaps
        expected = forward_kinematics(machine.mechanism, machine.geometry, joints[None], start).poses
        assert ball(*ways) == pytest.approx(expected.positions[0], abs=1e-8)
    # After a reversal within the smallest gap but that of joint 4, which has none, nothing else moves.
    joints[3] -= 0.01
    expected = forward_kinematics(machine.mechanism, machine.geometry, joints[None], start).poses
    assert ball(-0.01) == pytest.approx(expected.positions[0], abs=1e-8)


def test_all_of_them_together_add_up_in_the_lengths_of_the_legs() -> None:
    """Of a Gough-Stewart platform after a move: expansion, backlash, play and compliance."""
    changes = {"joints.backlash_mm": 0.06, "legs.play_mm": PLAY, "legs.compliance_um_n": COMPLIANCE}
    others = {"load.weight_n": 200.0, "temperature.rise_k": 5.0, "temperature.over_s": 10.0}
    machine = Machine("gough-stewart", **STILL | changes | others)
    physics, load = machine.physics(), machine.settings.load
    clock: Any = physics._clock
    physics.start_motion(
        np.stack([physics.encoder_positions(), machine.joints[1] + 9.0, machine.joints[1]])
    )
    clock.time_s += 100.0
    physics.gauge_displacement("x")
    grown = 1.0 + 5.0 * 11.5e-6
    warm, pose = Geometry(machine.mechanism.parameters, machine.geometry.vector * grown), physics._pose
    joints = (machine.joints[[1]] + 0.03) * grown
    tensions = imperfections.leg_tensions(machine.mechanism, warm, pose, joints, load)[0]
    assert np.abs(tensions).min() > imperfections.SEATED_N
    longer = 0.5 * np.array(PLAY) * np.sign(tensions) + 1e-3 * np.array(COMPLIANCE) * tensions
    ends = pose.positions[0] + warm["platform"] @ pose.rotations[0].T
    lengths = np.linalg.norm(ends - warm["base"], axis=1)
    assert lengths == pytest.approx(warm["offset"] + joints[0] + longer, abs=1e-7)
