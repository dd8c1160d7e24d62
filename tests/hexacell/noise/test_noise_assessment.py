"""From readings at the first reference to the noise of records: what counts, and what averaging gains."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.campaign.planner import Plan
from hexacell.campaign.time_model import TimeModel
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.sensitivity import free_sensitivity
from hexacell.noise.approach_scatter import ScatterSource
from hexacell.noise.measured_noise import AveragingForecast, with_measured_noise
from hexacell.noise.noise_assessment import (
    NoiseReadings,
    assess_noise,
    encoders_part,
    end_error,
    worthwhile_windows,
)
from hexacell.robot.model import robot_of
from hexacell.robot.stated import noise_of, stated_effects
from hexacell.uncertainty.effects import Occurrence
from tests.small_cell import changed

STATED = 0.01
REFERENCE = Pose(0.0, 0.0, 550.0)
WINDOW = 7
QUIET = 0.001


@pytest.fixture(scope="module")
def plan(bundled_cell) -> Plan:
    return Plan(bundled_cell.settings, robot_of(bundled_cell))


def allowing(plan: Plan, **noise: Any) -> Plan:
    """The plan with other settings in [noise]."""
    return with_changes(plan, {f"noise.{key}": value for key, value in noise.items()})


def with_changes(plan: Plan, changes: dict[str, Any]) -> Plan:
    """The plan with other settings; sets of poses that were planned before are kept."""
    other = replace(plan, settings=changed(plan.settings, changes))
    other.__dict__["planned_sets"] = plan.planned_sets
    return other


def jacobian(plan: Plan) -> np.ndarray:
    robot = plan.robot
    commands = robot.from_commands([REFERENCE])
    joints = robot.mechanism.inverse(robot.commanding, robot.branch, commands)
    by_joints = free_sensitivity(robot.mechanism, robot.commanding, commands, joints).joints[0, :3]
    return np.asarray(robot.frames.base.T @ by_joints)


def readings(
    plan: Plan,
    *,
    white: Any = QUIET,
    stops: float = STATED,
    sliders: float = 0.0,
    visits: int = 7,
    seed: int = 1,
    series: int = 40,
) -> NoiseReadings:
    """What a cell reads whose records have noise ``stops``, and readings ``white``, (9,) or all alike."""
    random = np.random.default_rng(seed)
    seen = 0.02 * random.standard_normal((visits, 6))
    ball = (seen + sliders * random.standard_normal((visits, 6))) @ jacobian(plan).T
    shown = np.concatenate([ball, seen], axis=1) + stops * random.standard_normal((visits, 9))
    return NoiseReadings(
        reference=REFERENCE,
        series=np.broadcast_to(white, (9,)) * random.standard_normal((series, 9)),
        steps=np.full(9, 1e-4),
        visits=shown,
        window_readings=WINDOW,
    )


def records_of(measured: Any) -> np.ndarray:
    return np.array([one.record for one in (*measured.gauges, *measured.encoders)])


def test_quiet_readings_do_not_replace_what_is_stated_for_records(plan) -> None:
    """A standstill shows the noise from reading to reading alone."""
    measured = assess_noise(plan, readings(plan))
    assert records_of(measured) == pytest.approx(np.full(9, STATED))
    assert not any(one.is_noisier for one in (*measured.gauges, *measured.encoders))
    assert [one.name for one in measured.gauges] == ["gauge x", "gauge y", "gauge z"]
    assert [one.name for one in measured.encoders] == [f"encoder {leg}" for leg in range(1, 7)]
    found = [one.reading for one in (*measured.gauges, *measured.encoders)]
    assert found == pytest.approx([QUIET] * 9, rel=0.4)


@pytest.mark.parametrize("row", [1, 5])
def test_one_noisy_instrument_is_named_and_counts_as_it_is(plan, row) -> None:
    white = np.full(9, QUIET)
    white[row] = 0.1
    measured = assess_noise(plan, readings(plan, white=white))
    every = (*measured.gauges, *measured.encoders)
    assert [one.is_noisier for one in every] == [place == row for place in range(9)]
    expected = np.full(9, STATED)
    expected[row] = 0.1 / np.sqrt(WINDOW)
    assert records_of(measured) == pytest.approx(expected, rel=0.3)
    noise = noise_of(with_measured_noise(plan.settings, measured))
    assert np.concatenate([noise.gauges_mm, noise.encoders]) == pytest.approx(records_of(measured))


def test_play_becomes_noise_of_the_encoders_and_the_repeatability_of_the_budget(plan) -> None:
    measured = assess_noise(plan, readings(plan, sliders=0.06))
    assert measured.approaches is not None
    assert measured.approaches.source is ScatterSource.JOINTS
    assert measured.approaches.excess == pytest.approx(0.06, rel=0.4)
    expected = np.hypot(STATED, measured.approaches.excess)
    assert records_of(measured)[3:] == pytest.approx(np.full(6, expected))
    assert records_of(measured)[:3] == pytest.approx(np.full(3, STATED))
    effects = stated_effects(with_measured_noise(plan.settings, measured))
    (line,) = (effect for effect in effects if effect.name == "repeatability of a slider")
    assert line.size == pytest.approx(1e3 * measured.approaches.excess)
    assert line.source == "7 visits of the first reference"
    assert line.occurrence is Occurrence.STOPS_AT_WORK


def test_what_is_less_than_stated_counts_only_where_the_cell_file_says_so(plan) -> None:
    quiet = readings(plan, stops=0.002, white=0.0005)
    assert records_of(assess_noise(plan, quiet)) == pytest.approx(np.full(9, STATED))
    measured = records_of(assess_noise(allowing(plan, figures="measured"), quiet))
    assert len(set(measured.round(9))) == 1
    assert 0.002 < measured[0] < 0.004  # the upper limit of 18 degrees of freedom


def test_the_measured_noise_is_rarely_below_the_true_one(plan) -> None:
    """It is an upper limit with 95 % confidence."""
    allowed = allowing(plan, figures="measured")
    found = [
        records_of(assess_noise(allowed, readings(plan, stops=0.004, seed=seed)))[4] for seed in range(40)
    ]
    assert np.mean(np.array(found) >= 0.004) >= 0.88
    assert np.median(found) < 0.007


def test_longer_readings_help_against_noise_from_reading_to_reading_alone(plan) -> None:
    white = np.sqrt(WINDOW) * STATED
    from_readings = assess_noise(allowing(plan, averaged_windows=16), readings(plan, white=white))
    from_stops = assess_noise(allowing(plan, averaged_windows=16), readings(plan))
    assert from_stops.windows == 1
    assert from_readings.windows > 1
    # The series does not show how much of what is stated differs from record to record: it may be all.
    expected = STATED * np.sqrt(1.0 + 1.0 / from_readings.windows)
    assert records_of(from_readings) == pytest.approx(np.full(9, expected), rel=0.1)


@pytest.mark.parametrize(
    ("changes", "windows"),
    [
        ({"noise.averaged_windows": 1}, 1),
        ({"acceptance.position_mm": 0.2}, 4),
        ({"acceptance.position_mm": 2.0}, 1),
        ({"identification.target_mm": 0.02}, 4),
        ({"identification.target_mm": 0.6, "acceptance.position_mm": 0.2}, 1),
        ({"identification.budget_minutes": 2.5, "acceptance.position_mm": 0.2}, 1),
    ],
)
def test_longer_readings_are_taken_unasked_where_the_accuracy_is_needed(plan, changes, windows) -> None:
    """A budget in minutes that is used up by one window a record pays for fewer records of several."""
    white = 3.0 * np.sqrt(WINDOW) * STATED
    measured = assess_noise(with_changes(plan, changes), readings(plan, white=white))
    assert measured.windows == windows


def test_without_a_series_or_visits_what_is_stated_holds(plan) -> None:
    nothing = replace(readings(plan, visits=1), series=np.zeros((0, 9)))
    measured = assess_noise(allowing(plan, averaged_windows=16, figures="measured"), nothing)
    assert records_of(measured) == pytest.approx(np.full(9, STATED))
    assert measured.approaches is None
    assert measured.windows == 1
    assert {one.reading for one in measured.gauges} == {None}


def test_the_part_of_the_encoders_and_the_rest_make_the_whole(plan) -> None:
    noise = plan.robot.noise
    part, whole = encoders_part(plan, noise), end_error(plan, noise)
    assert whole is not None
    assert part is not None
    assert 0.5 * whole < part < whole
    halved = end_error(plan, replace(noise, encoder=0.5 * noise.encoder))
    assert halved is not None
    assert halved == pytest.approx(np.sqrt(whole**2 - 0.75 * part**2), rel=0.15)


@pytest.mark.parametrize(
    ("errors", "most", "windows"),
    [
        ((0.20, 0.15, 0.11, 0.09), 16, 8),
        ((0.20, 0.15, 0.11, 0.09), 4, 4),
        ((0.20, 0.15, 0.11, 0.09), 3, 2),
        ((0.20, 0.15, 0.14, 0.05), 16, 2),
        ((0.20, 0.19, 0.10, 0.05), 16, 1),
        ((0.20, 0.10), 1, 1),
        ((), 16, 1),
    ],
)
def test_windows_are_doubled_as_long_as_it_pays(errors, most, windows) -> None:
    forecasts = tuple(
        AveragingForecast(windows=2**place, error_mm=error, minutes=0.0)
        for place, error in enumerate(errors)
    )
    assert worthwhile_windows(forecasts, most) == windows


def test_a_record_of_more_windows_takes_longer(plan) -> None:
    measured = assess_noise(plan, readings(plan))
    one, four = (
        TimeModel.of(with_measured_noise(plan.settings, measured.model_copy(update={"windows": windows})))
        for windows in (1, 4)
    )
    assert four.reading_s - one.reading_s == pytest.approx(3 * plan.settings.timing.window_s)
    assert four.move_s == one.move_s
