"""Runs of a robot with few parameters, whose records are linear: what is exact there needs no robot."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.drift.run_evidence import Causes, RunEvidence, WhitenedRecords
from hexacell.kinematics.rotations import Array

LEGS = np.array([1, 1, 2, 2, 3, 3])
CAUSES = Causes(np.eye(6), LEGS, 6)


@dataclass
class LinearRobot:
    """A robot of six parameters, of which each run shows a part of all, with ``noise``."""

    seed: int = 0
    noise: float = 1.0

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)
        self.calibration = self.random.standard_normal((60, 6))
        self.check = self.random.standard_normal((9, 6))
        self.state = self.random.standard_normal(6)

    def records(self, rows: Array, state: Array) -> WhitenedRecords:
        """Records at the true ``state``, linearized at 0."""
        rows = rows / self.noise
        residuals = -rows @ state + self.random.standard_normal(len(rows))
        return WhitenedRecords(np.zeros(6), rows, residuals)

    def nights(self, number: int) -> Iterator[RunEvidence]:
        """So many checks of it as it is now."""
        for _ in range(number):
            yield self.records(self.check, self.state).evidence

    def runs(self, number: int) -> Iterator[RunEvidence]:
        """A calibration, and so many checks."""
        yield self.records(self.calibration, self.state).evidence
        yield from self.nights(number)
