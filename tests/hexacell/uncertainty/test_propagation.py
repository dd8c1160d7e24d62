"""Effects through the estimator and at the task poses, against machines that have them.

Such a machine is solved by its leg equations, its exact records are fitted again, and the controller
commands the machine with what was found.
"""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.parameters import MachinePart
from hexacell.uncertainty import effect_kinds
from hexacell.uncertainty.effects import Effect, Occurrence
from tests.hexacell.conftest import vector

ALUMINIUM = {MachinePart.BASE: 6.0, MachinePart.LEGS: 23.0, MachinePart.PLATFORM: 12.0}
HALF_LENGTH_MM = 800.0
SHARE = 0.02
"""Of an error that its square may make: the propagation is of first order."""


def scaled(legs, share):
    """Encoders of some legs that show too little by a share."""

    def machine(laboratory):
        return lambda shown: (laboratory.paper.actual, shown * (1.0 + share * np.asarray(legs)))

    return machine


def displaced(legs, axis, displacement):
    """Rails on which sliders are displaced across, by a function of where they stand."""

    def machine(laboratory):
        def real(shown):
            joints = laboratory.paper.actual["S"].copy()
            along = joints[legs, 0] + shown[legs]
            joints[legs, axis] += displacement(along)
            return laboratory.changed(S=joints), shown

        return real

    return machine


def sine(along):
    return 0.02 / np.sqrt(2.0) * np.sin(2.0 * np.pi * along / 600.0)


CONSTANT = {
    "common scale": (effect_kinds.common_encoder_scale(1.0), 0, 50.0, scaled(np.ones(6), 50e-6)),
    "scale of encoder 3": (effect_kinds.encoder_scales(1.0), 2, 50.0, scaled(np.eye(6)[2], 50e-6)),
    "rail of legs 2 and 5, turned sideways": (
        effect_kinds.rail_directions(1.0),
        1,
        0.05,
        displaced([1, 4], 1, lambda along: 5e-5 * along),
    ),
    "rail of legs 3 and 4, turned upwards": (
        effect_kinds.rail_directions(1.0),
        5,
        0.05,
        displaced([2, 3], 2, lambda along: 5e-5 * along),
    ),
    "rail of legs 1 and 6, wavy sideways": (
        effect_kinds.rail_waves(1.0, 600.0),
        0,
        20.0,
        displaced([0, 5], 1, sine),
    ),
    "sag": (
        effect_kinds.common_sag(1.0, HALF_LENGTH_MM),
        0,
        50.0,
        displaced([0, 1, 2, 3, 4, 5], 2, lambda along: 0.05 * (along / HALF_LENGTH_MM) ** 2),
    ),
}


@pytest.mark.parametrize(("effect", "column", "size", "make"), CONSTANT.values(), ids=CONSTANT)
def test_an_effect_does_to_the_result_and_the_task_what_it_does_to_a_machine(
    laboratory, exact, propagation, effect: Effect, column, size, make
) -> None:
    machine = make(laboratory)
    found = laboratory.identified(laboratory.records_of(machine))
    change = size * propagation.parameter_columns(effect)[:, column]
    assert found.free - exact.free == pytest.approx(change, abs=SHARE * np.abs(change).max())
    expected = size * propagation.columns(effect).combined[..., column]
    errors = laboratory.task_errors(machine, found.geometry)
    assert errors[:, :3] == pytest.approx(expected[:, :3], abs=SHARE * np.abs(expected[:, :3]).max())
    assert errors[:, 3:] == pytest.approx(expected[:, 3:], abs=SHARE * np.abs(expected[:, 3:]).max())


@pytest.mark.parametrize("name", ["scale of encoder 3", "rail of legs 1 and 6, wavy sideways"])
def test_an_effect_adds_the_chi_square_that_its_records_have(laboratory, propagation, name) -> None:
    effect, column, size, make = CONSTANT[name]
    on_poses = effect.on_poses
    assert on_poses is not None
    alone = Effect("", 1.0, "", effect.occurrence, lambda place: on_poses(place)[..., [column]])
    found = laboratory.identified(laboratory.records_of(make(laboratory)))
    assert found.chi2 == pytest.approx(size**2 * propagation.chi_square(alone), rel=2 * SHARE)


def test_a_gauge_that_reads_too_much_is_propagated_through_the_result_only(laboratory, exact, propagation):
    records = laboratory.visits.measured().records
    changed = [_read(record, np.asarray(record.deviation) * [1.0, 1.001, 1.0]) for record in records]
    found = laboratory.identified(type(laboratory.visits.measured())(tuple(changed)))
    effect = effect_kinds.gauge_scales(1.0, is_estimated=False)
    change = propagation.parameter_columns(effect)[:, 1]
    assert found.free - exact.free == pytest.approx(change, abs=SHARE * np.abs(change).max())
    assert propagation.columns(effect).direct.size == 0


def test_an_ellipsoid_touched_by_three_plates_is_the_harmonic_of_its_axis(laboratory, exact, propagation):
    half_axes = 10.0 + np.array([0.0, 0.0, 0.006])
    touched = np.swapaxes(laboratory.visits.rotations, 1, 2)
    heights = np.linalg.norm(half_axes[:, None] * touched, axis=1) - 10.0
    measured = laboratory.visits.measured()
    first = {record.point: row for row, record in reversed(list(enumerate(measured.records)))}
    changed = tuple(
        _read(record, np.asarray(record.deviation) + heights[row] - heights[first[record.point]])
        for row, record in enumerate(measured.records)
    )
    found = laboratory.identified(type(measured)(changed))
    # 6 um (z^2 - 1/3) is 6 sqrt(12) / 3 um times the harmonic, the constant goes to the gauges' zero.
    columns = propagation.parameter_columns(effect_kinds.ball_roundness(1.0)) / np.sqrt(1.5)
    change = 6.0 * np.sqrt(12.0) / 3.0 * columns[:, 4]
    assert found.free - exact.free == pytest.approx(change, abs=SHARE * np.abs(change).max())


def _read(record, deviation):
    return replace(record, deviation=tuple(np.asarray(deviation).tolist()))


def test_a_stop_that_the_encoders_miss_is_one_cause_at_one_record(laboratory, exact, propagation) -> None:
    """All of them together have the covariance that each alone gives."""

    def alone(row, leg):
        def errors(place):
            columns = np.zeros((len(place), 6, 1))
            columns[row] = place.by_joints(1e-3 * np.broadcast_to(np.eye(6), (len(place), 6, 6)))[row][
                :, [leg]
            ]
            return columns

        return propagation.parameter_columns(Effect("", 1.0, "um", Occurrence.CONSTANT, errors))[:, 0]

    records = len(laboratory.visits.joints)
    each = np.array([alone(row, leg) for row in range(records) for leg in range(6)])
    columns = propagation.parameter_columns(effect_kinds.stop_repeatability(1.0))
    assert columns.shape[1] <= len(exact.free)
    assert columns @ columns.T == pytest.approx(each.T @ each, rel=1e-9, abs=1e-15)

    shown = laboratory.visits.joints[17]
    missed = np.where(np.arange(6) == 4, 0.02, 0.0)

    def machine(joints):
        return laboratory.paper.actual, joints + missed * np.array_equal(joints, shown)

    found = laboratory.identified(laboratory.records_of(machine))
    change = 20.0 * each[17 * 6 + 4]
    assert found.free - exact.free == pytest.approx(change, abs=SHARE * np.abs(change).max())


def test_a_missed_stop_at_a_task_pose_is_not_taught_away(laboratory, propagation) -> None:
    direct = propagation.columns(effect_kinds.stop_repeatability(1.0)).direct
    machine = lambda shown: (laboratory.paper.actual, shown + 0.01 * np.eye(6)[3])  # noqa: E731
    moved = laboratory.errors(machine, laboratory.paper.actual, laboratory.task)
    rows = range(len(laboratory.task))
    seen = np.array([10.0 * direct[row, :, 6 * row + 3] for row in rows])
    assert seen == pytest.approx(moved, rel=SHARE, abs=1e-6)
    assert np.count_nonzero(direct) == len(laboratory.task) * 36


def test_missed_stops_in_the_noise_of_the_records_act_at_work_alone(propagation) -> None:
    everywhere, at_work = (
        propagation.columns(effect_kinds.stop_repeatability(1.0, is_in_noise=in_noise))
        for in_noise in (False, True)
    )
    assert np.count_nonzero(everywhere.through)
    assert at_work.through.shape[-1] == 0
    np.testing.assert_array_equal(at_work.combined, everywhere.direct)
    assert propagation.chi_square(effect_kinds.stop_repeatability(1.0, is_in_noise=True)) == 0.0


def test_a_machine_that_is_warmer_at_work_errs_as_its_lengths_say(laboratory, propagation) -> None:
    actual, kelvin = laboratory.paper.actual, 5.0
    warm = laboratory.changed(
        S=actual["S"] * (1 + 6e-6 * kelvin),
        B=actual["B"] * (1 + 12e-6 * kelvin),
        l=actual["l"] * (1 + 23e-6 * kelvin),
    )
    errors = laboratory.task_errors(lambda shown: (warm, shown * (1 + 6e-6 * kelvin)), actual)
    expected = (
        kelvin * propagation.columns(effect_kinds.temperature_at_work(1.0, ALUMINIUM)).combined[..., 0]
    )
    assert errors == pytest.approx(expected, abs=SHARE * np.abs(expected[:, :3]).max())


def test_a_force_on_the_tool_bends_the_legs_as_springs_in_parallel(laboratory, propagation) -> None:
    """Stiffness K = J^T J / c by differences of the leg equations; the platform yields by K^-1 F."""

    def yielding(poses):
        legs, rows = laboratory.legs(laboratory.paper.actual), []
        for row, joints in enumerate(poses.joints):
            jacobian = legs.jacobian(joints, vector(poses.poses.pose(row)))
            rows.append(np.linalg.inv(jacobian.T @ jacobian)[:, :3] * 5e-5)
        return np.array(rows)

    effect = effect_kinds.load_at_work(1.0, 0.05)
    assert effect.on_poses is not None
    expected = yielding(propagation.task)
    assert effect.on_poses(propagation.task) == pytest.approx(expected, rel=1e-3, abs=1e-3 * expected.max())


def test_a_tool_beside_the_ball_turns_with_the_platform(propagation) -> None:
    effect = effect_kinds.ball_beside_tool(1.0)
    assert effect.on_poses is not None
    errors = effect.on_poses(propagation.task)
    assert errors[:, :3] == pytest.approx(propagation.task.poses.rotations)
    assert not errors[:, 3:].any()
    assert propagation.chi_square(effect) == 0.0
    assert propagation.parameter_columns(effect).shape[1] == 0


def test_an_estimate_shares_constant_effects_with_the_earlier_one_that_is_its_prior(
    laboratory, exact, propagation, visit
) -> None:
    """Few further records: most of what the effect did is in the prior, and is neither lost nor doubled."""
    effect, column, size, make = CONSTANT["rail of legs 1 and 6, wavy sideways"]
    machine, further = make(laboratory), replace(laboratory, visits=visit(points=2, orientations=6, seed=5))
    found = laboratory.identified(laboratory.records_of(machine))
    updated = laboratory.updated(found, further.records_of(machine))
    straight = laboratory.updated(exact, further.visits.measured())
    shared = laboratory.propagation(straight, {effect.name: propagation.parameter_columns(effect)})
    change = size * shared.parameter_columns(effect)[:, column]
    assert updated.free - straight.free == pytest.approx(change, abs=SHARE * np.abs(change).max())
    errors = laboratory.task_errors(machine, updated.geometry)
    expected = size * shared.columns(effect).combined[..., column]
    assert errors == pytest.approx(expected, abs=SHARE * np.abs(expected[:, :3]).max())


def test_missed_stops_of_an_earlier_estimate_are_other_ones(laboratory, exact, propagation, visit) -> None:
    effect = effect_kinds.stop_repeatability(1.0)
    further = visit(points=2, orientations=6, seed=5)
    updated = laboratory.updated(exact, further.measured())
    before = propagation.parameter_columns(effect)
    alone = laboratory.propagation(updated).parameter_columns(effect)
    shared = laboratory.propagation(updated, {effect.name: before}).parameter_columns(effect)
    through_prior = updated.free_covariance @ np.linalg.inv(exact.free_covariance) @ before
    together = alone @ alone.T + through_prior @ through_prior.T
    assert shared @ shared.T == pytest.approx(together, rel=1e-6, abs=1e-6 * np.abs(together).max())
