"""From a series at standstill and visits of one pose to the noise that a run counts with.

A standstill shows the part from reading to reading alone, with the rounding of the displays. What is
stated of a record is mostly the other part, which stays as long as the robot stands; of an instrument whose
readings scatter nearly as much as that, both count. What the visits show beyond is added to its source.
Where the cell file allows it, less than stated counts as well, by the upper limit of what the visits
show. The mean of more readings is better in the part from reading to reading, and in no other.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.planner import Plan
from hexacell.campaign.time_model import TimeModel
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array, Mask
from hexacell.noise import measured_noise
from hexacell.noise.approach_scatter import RepeatedApproaches, ScatterSource, approach_scatter
from hexacell.noise.ball_by_encoders import BallByEncoders
from hexacell.noise.standstill import SIGNIFICANCE, ReadingNoise, reading_noise
from hexacell.uncertainty.statement import COVERAGE_FACTOR

LEAST_SHARE = 0.3
"""Share of what is stated from which the readings count too: less makes it larger by 5 % at most."""

WINDOWS = (1, 2, 4, 8, 16)
"""Numbers of windows that are compared."""
WORTHWHILE = 0.9
"""A larger number is taken if the predicted error is at most such a share of that with half as many."""
MOST_UNASKED = 4
"""Windows that a run takes at most where the cell file states no number."""
NEAR_LIMIT = 0.5
"""Share of the limit within which U by the noise, with the guard band, needs no more windows unasked: the
rest is for the error itself and the systematic effects."""
PERFECT = 1e-3
"""Share of the noise of encoders that count as perfect."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseReadings:
    """What was read at the first reference.

    Attributes:
        reference: its pose, in the controller's frames.
        series: readings at standstill (n, 3 + J), mm: gauges x, y, z, then the encoders; n may be zero.
        steps: of their displays (9,), mm.
        visits: means of the settled windows at each visit (m, 3 + J), mm, the first one included.
    """

    reference: Pose
    series: Array
    steps: Array
    visits: Array
    window_readings: int


def assess_noise(plan: Plan, readings: NoiseReadings) -> measured_noise.MeasuredNoise:
    """The noise of the records that a plan is carried out with from now on."""
    assessment, stated = _NoiseAssessment(plan, readings), plan.robot.noise
    noise = {
        windows: stated.with_devices(sigma[3:].tolist(), sigma[:3].tolist())
        for windows, sigma in {windows: assessment.of_records(windows) for windows in WINDOWS}.items()
    }
    forecasts = averaging_forecasts(plan, noise)
    windows = _windows_taken(plan, forecasts)
    x, y, z, *encoders = assessment.instruments(windows)
    return measured_noise.MeasuredNoise(
        gauges=(x, y, z),
        encoders=tuple(encoders),
        approaches=assessment.scatter,
        windows=windows,
        forecasts=forecasts,
        encoders_part_mm=encoders_part(plan, noise[1]),
    )


def visits_agree(plan: Plan, readings: NoiseReadings) -> bool:
    """Whether the noise of a plan's robot, or of the readings at rest, explains the visits so far."""
    scatter = _NoiseAssessment(plan, readings).scatter
    return scatter is None or scatter.source is None


def assess_again(
    plan: Plan,
    readings: NoiseReadings,
    measured: measured_noise.MeasuredNoise,
    found: Identification,
    drifted_mm: float = 0.0,
) -> measured_noise.MeasuredNoise:
    """The noise by the same readings, once the geometry is known by which the encoders move the ball.

    Near a singularity the drawing may be wrong by half in that. The records were taken as ``measured``. By
    the visits gauges are known to have ``drifted_mm`` about their mean, which is no noise.
    """
    again = _NoiseAssessment(plan, readings, found, drifted_mm)
    x, y, z, *encoders = again.instruments(measured.windows)
    update = {"gauges": (x, y, z), "encoders": tuple(encoders), "approaches": again.scatter}
    return measured.model_copy(update=update)


@dataclass(frozen=True, eq=False)
class _NoiseAssessment:
    """The parts of one assessment; arrays (9,) have gauges x, y, z, then the encoders."""

    plan: Plan
    readings: NoiseReadings
    found: Identification | None = None
    drifted_mm: float = 0.0

    @cached_property
    def stated(self) -> Array:
        """The stated noise of a record (9,), mm."""
        noise = self.plan.robot.noise
        return np.concatenate([noise.gauges_mm, noise.encoders])

    @cached_property
    def reading_noise(self) -> tuple[ReadingNoise, ...]:
        """What the series shows of each instrument; empty without a series."""
        series = self.readings.series
        each = zip(series.T, self.readings.steps.tolist(), strict=True)
        return tuple(reading_noise(*one) for one in each) if len(series) else ()

    @cached_property
    def scatter(self) -> RepeatedApproaches | None:
        """What the visits show beyond the stated noise and that of the readings."""
        robot, visits, least = self.plan.robot, self.readings.visits, self._at_least(self.stated)
        command = robot.from_commands([self.readings.reference])
        ball = BallByEncoders.at(robot, robot.belief(self.found), command)
        unit = robot.mechanism.words.joint_unit
        gauges = np.hypot(least[:3], self.drifted_mm)
        found = approach_scatter(visits[:, :3], visits[:, 3:], ball, least[3:], gauges, unit)
        if self.found is not None and found is not None and found.source is ScatterSource.JOINTS:
            # How large it is, all repeats of a run say together, see :mod:`.repeats`.
            return found.model_copy(update={"source": None, "excess": 0.0})
        return found

    def of_records(self, windows: int) -> Array:
        """The noise (9,) of records that are means of some windows, with what does not repeat."""
        scatter, allowed = self.scatter, self.stated
        allows_less = self.plan.settings.noise.figures == "measured"
        if allows_less and scatter is not None and scatter.source is None:
            allowed = self.stated * min(scatter.ratio_at_most, 1.0)  # less than stated, if visits prove it
        one = self._at_least(allowed)
        if scatter is not None and scatter.source is not None:
            one = np.hypot(one, scatter.excess * scatter.source.instruments(len(one) - 3))
        if not self.reading_noise or windows == 1:
            return one
        count = self.readings.window_readings
        first, mean = (
            np.array([noise.of_mean(number) for noise in self.reading_noise])
            for number in (count, windows * count)
        )
        return np.asarray(np.sqrt(np.maximum(one**2 - first**2, 0.0) + mean**2))

    def _at_least(self, sigma: Array) -> Array:
        """Noise (9,) with that of the readings, where these prove that it matters."""
        matters, count = self._readings_exceed(LEAST_SHARE * sigma), self.readings.window_readings
        readings = [noise.of_mean(count) for noise in self.reading_noise]
        return np.hypot(sigma, np.where(matters, readings, 0.0)) if readings else sigma

    def _readings_exceed(self, sigma: Array) -> Mask:
        """The instruments (9,) whose readings alone make a record noisier than ``sigma`` (9,)."""
        if not self.reading_noise:
            return np.zeros(len(self.stated), dtype=bool)
        count, significance = self.readings.window_readings, SIGNIFICANCE / len(self.stated)
        each = zip(self.reading_noise, sigma.tolist(), strict=True)
        return np.array([noise.exceeds(mm, count, significance) for noise, mm in each])

    def instruments(self, windows: int) -> Iterator[measured_noise.InstrumentNoise]:
        """The noise of each, in records that are means of some windows."""
        records = self.of_records(windows)
        gauges = sorted(self.plan.settings.gauges, key=lambda gauge: gauge.axis)
        names = [
            *(f"gauge {one.name}" for one in gauges),
            *(f"encoder {leg + 1}" for leg in range(len(self.stated) - 3)),
        ]
        units = [JointUnit.MM] * 3 + [self.plan.robot.mechanism.words.joint_unit] * (len(names) - 3)
        larger = self._readings_exceed(self.stated)
        for row, (name, unit) in enumerate(zip(names, units, strict=True)):
            yield measured_noise.InstrumentNoise(
                name=name,
                unit=unit,
                stated=float(self.stated[row]),
                is_noisier=bool(larger[row]),
                record=float(records[row]),
                **(asdict(self.reading_noise[row]) if self.reading_noise else {}),
            )


def averaging_forecasts(
    plan: Plan, noise: Mapping[int, Noise]
) -> tuple[measured_noise.AveragingForecast, ...]:
    """Errors by the noise of records of some windows each; empty where no accuracy is predicted."""
    records = sum(plan.forecaster.planned(CampaignState()).values())
    found = []
    for windows, one in noise.items():
        minutes = records * measured_noise.averaging_seconds(plan.settings, windows) / 60.0
        if (error := end_error(plan, one, windows)) is not None:
            forecast = measured_noise.AveragingForecast(windows=windows, error_mm=error, minutes=minutes)
            found.append(forecast)
    return tuple(found)


def encoders_part(plan: Plan, noise: Noise) -> float | None:
    """What the noise of the encoders contributes to the predicted error, mm."""
    perfect = replace(noise, encoder=PERFECT * noise.encoder)
    error, other = end_error(plan, noise), end_error(plan, perfect)
    return None if error is None or other is None else max(error**2 - other**2, 0.0) ** 0.5


def end_error(plan: Plan, noise: Noise, windows: int = 1) -> float | None:
    """The predicted error at the worst task pose once all is measured, one standard deviation, mm.

    Records of more windows take longer: a budget in minutes pays for fewer.
    """
    times = TimeModel.of(measured_noise.with_windows(plan.settings, windows))
    forecaster = replace(plan.forecaster, times=lambda _: times)
    belief = replace(plan.robot.belief(), noise=noise)
    after = forecaster.predicted_belief(belief, CampaignState())
    return forecaster.worst_error(CampaignState(), after)


def mean_of_independent(noise: Noise, windows: int) -> Noise:
    """The noise of means of some windows, if all of it differs from reading to reading."""
    return replace(noise, encoder=noise.encoder / windows**0.5, gauge_mm=noise.gauge_mm / windows**0.5)


def worthwhile_windows(
    forecasts: tuple[measured_noise.AveragingForecast, ...], most: int, enough_mm: float = 0.0
) -> int:
    """How many windows to average: as many as pay, each number against the one before it.

    No more are taken once the error is ``enough_mm``.
    """
    best = 1
    for fewer, more in pairwise(forecasts):
        pays = more.error_mm <= WORTHWHILE * fewer.error_mm and fewer.error_mm > enough_mm
        if more.windows > most or not pays:
            break
        best = more.windows
    return best


def _windows_taken(plan: Plan, forecasts: tuple[measured_noise.AveragingForecast, ...]) -> int:
    """How many windows each record of a run is the mean of.

    What a goal other than the geometry needs, no error at the task poses says.
    """
    stated, limits = plan.settings.noise.averaged_windows, plan.settings.acceptance
    if stated is not None or plan.goal is not None:
        return worthwhile_windows(forecasts, stated or 1)
    enough_mm = plan.settings.identification.target_mm
    if enough_mm is None:
        enough_mm = NEAR_LIMIT * limits.position_mm / limits.guard_band_factor
    return worthwhile_windows(forecasts, MOST_UNASKED, enough_mm / COVERAGE_FACTOR)
