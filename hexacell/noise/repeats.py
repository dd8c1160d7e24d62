"""The noise of a record by everything that a run measured twice.

A few visits of one reference show the noise only roughly. At the end of each set its reference is read once
more: what the encoders do not explain of the change is the noise of two readings. All together are one
estimate of pure error, which is compared with the noise that the run counts with.

Source: Draper and Smith, Applied Regression Analysis, 3rd ed. 1998, chapter 2 (pure error).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hexacell.distributions import chi_square_exceedance
from hexacell.identification.problem.prior import Noise
from hexacell.noise.allowances import ReferenceChange
from hexacell.noise.approach_scatter import RepeatedApproaches

SIGNIFICANCE = 0.01
"""Probability of the noise that is counted with below which the repeats show that it is larger."""

LEAST_FREEDOM = 9
"""Fewer degrees of freedom say nothing of use."""


@dataclass(frozen=True, slots=True)
class Repeats:
    """What repeated readings show of the noise that a run counts with.

    Attributes:
        chi2: of all repeats under that noise.
        freedom: their degrees of freedom.
        is_measured: whether that noise was measured by some of them, not stated.
    """

    chi2: float
    freedom: float
    is_measured: bool

    @classmethod
    def of(cls, approaches: RepeatedApproaches | None, changes: Iterable[ReferenceChange]) -> Repeats:
        """By visits of one reference, and by how readings at others changed."""
        chi2 = freedom = 0.0
        is_measured = approaches is not None and approaches.source is not None
        if approaches is not None:
            freedom += approaches.degrees_of_freedom
            chi2 += freedom * (1.0 if is_measured else approaches.ratio**2)
        for change in changes:
            shown = change.unexplained_mm
            chi2 += float(shown @ np.linalg.solve(change.covariance, shown))
            freedom += len(shown)
        return cls(chi2, freedom, is_measured)

    @property
    def factor(self) -> float:
        """Factor of all noise, above 1 where the repeats show that it is larger."""
        if self.freedom < LEAST_FREEDOM or chi_square_exceedance(self.freedom, self.chi2) >= SIGNIFICANCE:
            return 1.0
        return float(np.sqrt(self.chi2 / self.freedom))

    def applied_to(self, noise: Noise) -> Noise:
        """The noise as the repeats show it; what is stated stays unless they contradict it."""
        if self.factor == 1.0 and not self.is_measured:
            return noise
        return replace(noise.scaled(self.factor), freedom=self.freedom)

    def unseen_stops(self, noise: Noise) -> float:
        """Where joints stop beside what their encoders show, as far as the ``noise`` has no room for it.

        Which instrument it is of is not known: at work it counts as of the joints, which is the worst.
        """
        return noise.encoder * float(np.sqrt(self.factor**2 - 1.0))
