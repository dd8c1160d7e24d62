"""Forecast of what it gains to take the mean of several settled windows for a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.planner import Plan
from hexacell.identification.problem.problem import Noise
from hexacell.noise.measured_noise import AveragingForecast, averaging_seconds

WINDOWS = (1, 2, 4, 8, 16)
"""Numbers of windows that are compared."""
WORTHWHILE = 0.9
"""A larger number is taken if the predicted error is at most such a share of that with half as many."""
PERFECT = 1e-3
"""Share of the noise of encoders that count as perfect."""


@dataclass(frozen=True, slots=True, eq=False)
class AveragingForecaster:
    """Forecasts the error of one plan, as nothing is measured yet."""

    plan: Plan

    def forecasts(self, noise: Mapping[int, Noise]) -> tuple[AveragingForecast, ...]:
        """For the noise of records of some windows each; empty where no accuracy is predicted."""
        errors = {windows: self.end_error(one) for windows, one in noise.items()}
        records = sum(self.plan.forecaster.planned(CampaignState()).values())
        settings = self.plan.settings
        return tuple(
            AveragingForecast(
                windows=windows,
                error_mm=error,
                minutes=records * averaging_seconds(settings, windows) / 60.0,
            )
            for windows, error in errors.items()
            if error is not None
        )

    def encoders_part(self, noise: Noise) -> float | None:
        """What the noise of the encoders contributes to the predicted error, mm."""
        error, other = (self.end_error(one) for one in (noise, perfect_encoders(noise)))
        return None if error is None or other is None else max(error**2 - other**2, 0.0) ** 0.5

    def end_error(self, noise: Noise) -> float | None:
        """The predicted error at the worst task pose once all is measured, one standard deviation, mm."""
        belief = replace(self.plan.robot.belief(), noise=noise)
        after = self.plan.forecaster.predicted_belief(belief, CampaignState())
        return self.plan.forecaster.worst_error(CampaignState(), after)


def perfect_encoders(noise: Noise) -> Noise:
    """The same gauges with encoders that are hardly noisy."""
    return replace(noise, encoder=PERFECT * noise.encoder)


def mean_of_independent(noise: Noise, windows: int) -> Noise:
    """The noise of means of some windows, if all of it differs from reading to reading."""
    return replace(noise, encoder=noise.encoder / windows**0.5, gauge_mm=noise.gauge_mm / windows**0.5)


def worthwhile_windows(forecasts: tuple[AveragingForecast, ...], most: int) -> int:
    """How many windows to average: as many as pay, each number against the one before it."""
    best = 1
    for fewer, more in pairwise(forecasts):
        if more.windows > most or more.error_mm > WORTHWHILE * fewer.error_mm:
            break
        best = more.windows
    return best
