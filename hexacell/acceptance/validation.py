"""The held-out verdict: how far the ball strays at points that took no part in the fit."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from hexacell.kinematics.rotations import Array


class Verdict(StrEnum):
    """What the held-out measurements say."""

    PASS = "pass"  # noqa: S105 - a verdict, not a password
    OUT_OF_LIMITS = "out of limits"
    WORSE = "worse than before"
    NOT_EVALUATED = "not evaluated"


@dataclass(frozen=True, slots=True)
class DeviationStatistics:
    """Distances of the ball from each point's reference: mean and largest, mm, over ``poses``."""

    mean_mm: float
    largest_mm: float
    poses: int

    @classmethod
    def of(cls, deviations: ArrayLike) -> DeviationStatistics | None:
        """Of deviations (n, 3), mm, references left out; nothing where one is missing or not finite."""
        distances: Array = np.linalg.norm(np.reshape(np.asarray(deviations, dtype=float), (-1, 3)), axis=-1)
        if not len(distances) or not np.isfinite(distances).all():
            return None
        return cls(float(distances.mean()), float(distances.max()), len(distances))


def validate(
    before: DeviationStatistics | None,
    after: DeviationStatistics | None,
    *,
    mean_mm: float,
    largest_mm: float,
) -> Verdict:
    """The verdict under limits on the mean and the largest distance, mm; no evidence is no pass."""
    if before is None or after is None:
        return Verdict.NOT_EVALUATED
    if after.mean_mm > before.mean_mm:
        return Verdict.WORSE
    within = after.mean_mm <= mean_mm and after.largest_mm <= largest_mm
    return Verdict.PASS if within else Verdict.OUT_OF_LIMITS
