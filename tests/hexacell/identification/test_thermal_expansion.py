"""Records of machines that become warmer while measuring, with thermometers on their legs and base."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.identification.estimator import identify
from hexacell.identification.placement import Placement
from hexacell.identification.thermal_expansion import ThermalExpansion, known_parts
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import robot_of
from hexacell.uncertainty.effect_kinds import expansion_coefficients, thermometers_of_legs
from hexacell.uncertainty.effects import errors_of_records
from tests.benchmarks.machines import bundled

UM_M_K = 23.0
RISE_K = np.array([6.0, 4.5, 5.0, 3.0, 5.5, 4.0])
MECHANISMS = ("simulated-hexaglide", "gough-stewart", "rotary-cranks")


@pytest.mark.parametrize("name", MECHANISMS)
def test_joints_without_the_expansion_are_those_of_the_cold_machine(name) -> None:
    """They bring it where the warm one is, whose legs are longer, by forward kinematics."""
    cell = bundled(name)
    robot = robot_of(cell)
    cold, kinds = robot.mechanism.normalize_frames(robot.drawing)[0], robot.mechanism.parameters.parameters
    of_legs = np.array([RISE_K[one.leg - 1] * (one.kind.part is MachinePart.LEGS) for one in kinds])
    warm = Geometry(cold.parameters, cold.vector * (1.0 + 1e-6 * UM_M_K * of_legs))
    turns = rotations.from_angles(np.random.default_rng(1).uniform(-0.15, 0.15, (20, 3)))
    point = np.array(cell.settings.identification.points[0][:3])
    poses = robot.frames.poses(PoseBatch.at(point, turns))
    joints = robot.mechanism.inverse(cold, robot.branch, poses)
    there = forward_kinematics(robot.mechanism, warm, joints, poses).poses
    warmer = np.tile([*RISE_K, 0.0], (20, 1))
    at = Placement(robot.mechanism, cold, poses, joints)
    without = ThermalExpansion(UM_M_K, UM_M_K).joints_without(at, warmer)
    found = forward_kinematics(robot.mechanism, cold, without, poses).poses
    assert np.abs(there.positions - poses.positions).max() > 0.02
    np.testing.assert_allclose(found.positions, there.positions, atol=1e-4)
    np.testing.assert_allclose(found.rotations, there.rotations, atol=1e-6)


def warm(cold, machine, truth: Geometry, base_k: float, seed: int) -> MeasurementSet:
    """Records of a machine whose legs become warmer by RISE_K from 21 deg C on, and its base from 20 on.

    The platform is like the base, on which the gauges stand.
    """
    progress, lengths = np.linspace(0.0, 1.0, len(cold.labels))[:, None], truth.parameters.slices["l"]
    shown = [*[21.0] * 6, 20.0] + progress * [*RISE_K, base_k]
    grown, balls = 1.0 + 1e-6 * UM_M_K * (shown - 20.0), []
    for q, ball, turn, (*by_leg, base) in zip(cold.joints, cold.balls, cold.rotations, grown, strict=True):
        vector = base * truth.vector
        vector[lengths] = by_leg * truth.vector[lengths]
        near = np.concatenate([ball, Rotation.from_matrix(turn).as_rotvec()])
        closed = machine(Geometry(truth.parameters, vector)).closed(base * q, near)
        balls.append(closed[:3] - (base - 1.0) * ball)
    records = replace(cold, balls=np.array(balls)).measured(0.01, seed).records
    pairs = zip(records, shown.tolist(), strict=True)
    return MeasurementSet(tuple(replace(one, temperatures=tuple(row)) for one, row in pairs))


@pytest.mark.parametrize("base_k", [0.0, 2.0])
def test_the_geometry_is_as_good_as_that_of_a_machine_that_stays_cold(
    base_k, paper, visit, legs, make_problem
) -> None:
    held_out = make_problem(visit(seed=77).measured())

    def squares(problem) -> float:
        """Of the errors of the geometry at 20 deg C, in exact records of the cold machine."""
        errors = held_out.solve_poses(identify(problem).free).poses.positions - held_out.deviations
        means = held_out.per_record(held_out.group_sums(errors)) / 11
        return float(np.mean((errors - means) ** 2))

    sums = np.zeros(3)
    for seed in range(3):
        cold = visit(seed=seed)
        told = warm(cold, legs, paper.actual, base_k, seed)
        corrected = make_problem(told, expansion=ThermalExpansion(UM_M_K, UM_M_K, (20.0,) * 7))
        problems = make_problem(cold.measured(0.01, seed)), corrected, make_problem(told)
        sums += [squares(one) for one in problems]
    as_cold, with_temperatures, without = np.sqrt(sums)
    assert with_temperatures < 1.2 * as_cold
    assert without > 1.5 * as_cold


@pytest.fixture
def told(visit) -> MeasurementSet:
    """Records of legs and base that become warmer; a thermometer is silent now and then."""
    records = visit(points=3, orientations=4, seed=4).measured(0.01, seed=2).records
    shown = [(20.0 + n, *[21.0] * 4, None if n % 3 else 22.0 + n, 20.5 + n) for n in range(len(records))]
    return MeasurementSet(
        tuple(replace(one, temperatures=row) for one, row in zip(records, shown, strict=True))
    )


def test_a_problem_that_is_extended_is_the_one_of_all_its_records(told, make_problem) -> None:
    """A record may change what is known of the temperature before it."""
    expansion = ThermalExpansion(UM_M_K, UM_M_K)
    known = make_problem(MeasurementSet(told.records[:3]), expansion=expansion)
    for count in range(4, len(told) + 1):
        known = make_problem(MeasurementSet(told.records[:count]), known=known, expansion=expansion)
    whole = make_problem(told, expansion=expansion)
    np.testing.assert_array_equal(known.joints, whole.joints)
    np.testing.assert_array_equal(known.warmer, whole.warmer)
    half = whole.subset(whole.labels[:, 0] == 1).joined(whole.subset(whole.labels[:, 0] > 1))
    np.testing.assert_array_equal(half.warmer, whole.warmer)
    assert np.abs(whole.joints - make_problem(told).joints).max() > 0.1


def test_gaps_are_filled_and_the_first_record_is_the_reference(told) -> None:
    warmer = ThermalExpansion(UM_M_K, UM_M_K).warmer(told)
    rows = np.arange(len(told))
    np.testing.assert_allclose(warmer[:, 0], rows)
    np.testing.assert_allclose(warmer[:10, 5], rows[:10])
    assert ThermalExpansion(UM_M_K, UM_M_K, (20.0,) * 7).warmer(told)[0].tolist() == [0, 1, 1, 1, 1, 2, 0.5]
    bare = MeasurementSet(tuple(replace(one, temperatures=()) for one in told.records))
    assert not ThermalExpansion(UM_M_K, UM_M_K, (20.0,) * 7).warmer(bare).any()


def test_a_leg_without_a_thermometer_is_like_the_base() -> None:
    rows = [(None, 20.0, 20.0, 20.0, 20.0, 20.0, base) for base in (20.0, 22.0)]
    assert known_parts(rows, 6) == frozenset()
    assert known_parts([(1.0, *row[1:]) for row in rows], 6) == {MachinePart.LEGS, MachinePart.BASE}
    assert known_parts([(1.0, *row[1:6]) for row in rows], 6) == {MachinePart.LEGS}
    assert known_parts([], 6) == frozenset()


@pytest.mark.parametrize(("column", "share"), [(0, (1.1, 1.0)), (1, (1.0, 1.1))])
def test_what_is_not_known_of_the_expansion_acts_as_its_error_does(told, make_problem, column, share):
    coefficients = np.array([UM_M_K, 10.0])
    expansions = ThermalExpansion(*coefficients), ThermalExpansion(*(coefficients * share))
    right, wrong = (make_problem(told, expansion=one) for one in expansions)
    placed = right.measured_at(right.initial_parameters, right.start)
    seen = placed.by_joints((wrong.joints - right.joints)[..., None])[:, :3, 0]
    by_percent = errors_of_records(expansion_coefficients(1.0, *coefficients), placed)[..., column]
    np.testing.assert_allclose(10.0 * by_percent, seen, atol=0.03 * np.abs(seen).max())


def test_thermometers_err_by_what_a_leg_is_longer_from_the_first_record_to_the_last(identified) -> None:
    at = identified.placement
    errors = errors_of_records(thermometers_of_legs(0.5, UM_M_K), at)
    lengths = np.zeros(len(at.geometry.vector))
    lengths[at.geometry.parameters.names.index("l3")] = 0.5e-6 * UM_M_K * at.geometry["l"][2]
    longer = at.by_parameters(lengths[:, None])[:, :3, 0]
    np.testing.assert_allclose(errors[[0, -1], :, 2], longer[[0, -1]] * [[-1.0], [1.0]], atol=1e-9)
