"""The estimate of a robot whose geometry may have drifted: under several scales of the drift at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.online_estimate import OnlineEstimate, OnlineEstimator
from hexacell.identification.problem.prior import IdentifiedBefore
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot

USUAL_SCALES = (1.0, 3.0, 10.0)
"""All as likely as each other before measuring."""

LARGE_SCALES = (30.0, 100.0)
"""Considered where the one below is the likeliest so far: a robot that was hit, or has another config."""

GUARDED_SCALE = 3.0
"""The least scale that poses are chosen for, and under which a robot must be within its limit to pass."""

FIRST_SCALE = 10.0
"""The least scale that the first poses are chosen for: they must keep the ball inside the travel."""

FIRST_RECORDS = 3


@dataclass(frozen=True, slots=True, eq=False)
class ScaledEstimate:
    """The estimate under one scale of the drift."""

    scale: float
    estimate: OnlineEstimate
    log_likelihood: float

    @classmethod
    def of(cls, scale: float, estimate: OnlineEstimate, records: int) -> ScaledEstimate:
        """An estimate of so many records; one that leaves some of them out is the least likely."""
        found = estimate.identification
        if found is None:
            return cls(scale, estimate, 0.0)
        is_whole = found.records == records
        return cls(scale, estimate, found.log_marginal_likelihood if is_whole else -np.inf)


class DriftEstimator:
    """Estimates one robot under each scale of its drift since it was identified."""

    def __init__(self, robot: Robot, before: IdentifiedBefore) -> None:
        self._robots = {
            scale: replace(robot, known=before.prior(scale)) for scale in USUAL_SCALES + LARGE_SCALES
        }
        self._estimators = {
            scale: OnlineEstimator(one, tries_other_starts=False) for scale, one in self._robots.items()
        }

    @property
    def robot(self) -> Robot:
        """The robot with what is known of it before the first record, under the guarded scale."""
        return self._robots[GUARDED_SCALE]

    def estimate(self, measurements: MeasurementSet) -> OnlineEstimate:
        """The estimate that poses are chosen by."""
        least = FIRST_SCALE if len(measurements) < FIRST_RECORDS else GUARDED_SCALE
        return self.at_least(least, measurements).estimate

    def likeliest(self, measurements: MeasurementSet) -> ScaledEstimate:
        """The estimate under the scale with the largest marginal likelihood, the smallest of equals."""
        return max(self._considered(measurements), key=lambda one: one.log_likelihood)

    def at_least(self, scale: float, measurements: MeasurementSet) -> ScaledEstimate:
        """The estimate under the likeliest scale, or under a ``scale`` of these that is larger."""
        likeliest = self.likeliest(measurements)
        return likeliest if likeliest.scale >= scale else self._at(scale, measurements)

    def _considered(self, measurements: MeasurementSet) -> Iterator[ScaledEstimate]:
        usual = [self._at(scale, measurements) for scale in USUAL_SCALES]
        yield from usual
        best = max(one.log_likelihood for one in usual)
        last = usual[-1]
        for scale in LARGE_SCALES:
            if len(measurements) == 0 or last.log_likelihood < best:
                return
            last = self._at(scale, measurements)
            best = max(best, last.log_likelihood)
            yield last

    def _at(self, scale: float, measurements: MeasurementSet) -> ScaledEstimate:
        estimate = self._estimators[scale].estimate(measurements)
        return ScaledEstimate.of(scale, estimate, len(measurements))
