"""Optimality criteria of designs, and the certificate of the equivalence theorem.

Of the information M of a design, the prior's included, with p parameters:

- D: the volume of the confidence ellipsoid. The D-efficiency of M against another N is
  ``(det M / det N)^(1/p)``;
- I (or V): the mean variance ``tr(L M^-1)`` of predictions with the weight L, here of the ball's
  position at the task poses. The I-efficiency is ``tr(L N^-1) / tr(L M^-1)``.

The same share of the records, taken by the best design, would do as well.

**Certificate.** For D let ``G G^T = M^-1``, for I ``G G^T = M^-1 L M^-1``. A record's sensitivity is the
derivative by its weight, ``s = |R (J - Z K) G|^2`` (see :mod:`.measure`). If the k records of each point
are distributed in any other way, giving N, then

    tr(G^T N G) <= tr(G^T F G) + sum over points of k max s =: g,

where F is the information of the prior and of the records that every design has, with those centres;
because N is no larger with its own centres than with those of M. With ``t = tr(G^T M G)``, which is p for
D and ``tr(L M^-1)`` for I,

- D: ``det(M^-1 N) <= (tr(M^-1 N) / p)^p <= (g / t)^p``, by the means of the eigenvalues of the product;
- I: ``tr(L N^-1) >= tr(L M^-1)^2 / tr(G^T N G) >= t^2 / g``, by the inequality of Cauchy and Schwarz.

In both cases no distribution is better by more than ``g / t``: M has at least the efficiency ``t / g``. It
is 1 for the best measure and for no other (equivalence theorem; Kiefer and Wolfowitz 1960; with bounds:
Atwood 1969).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hexacell.kinematics.rotations import Array


class Optimality(Protocol):
    """A criterion of designs."""

    @property
    def curvature(self) -> float:
        """Factor of the second derivatives by weights; see :mod:`.weights`."""

    def factor(self, information: Array) -> Array:
        """G (p, r) at an information (p, p), the prior's included."""

    def efficiency(self, information: Array, best: Array) -> float:
        """Of an information (p, p) against that of a better design."""


@dataclass(frozen=True, slots=True)
class DOptimality:
    """The volume of the confidence ellipsoid."""

    curvature: float = 1.0

    def factor(self, information: Array) -> Array:
        """See :class:`Optimality`."""
        factor: Array = np.linalg.inv(np.linalg.cholesky(information)).T
        return factor

    def efficiency(self, information: Array, best: Array) -> float:
        """See :class:`Optimality`."""
        difference = np.linalg.slogdet(information)[1] - np.linalg.slogdet(best)[1]
        return float(np.exp(difference / len(information)))


@dataclass(frozen=True, slots=True, eq=False)
class IOptimality:
    """The mean variance of predictions.

    Attributes:
        predictions: derivatives (r, p) of what is predicted, ``L`` being the mean of their squares.
    """

    predictions: Array
    curvature: float = 2.0

    def factor(self, information: Array) -> Array:
        """See :class:`Optimality`."""
        factor: Array = np.linalg.solve(information, self.predictions.T)
        return factor

    def efficiency(self, information: Array, best: Array) -> float:
        """See :class:`Optimality`."""
        return self._variance(best) / self._variance(information)

    def _variance(self, information: Array) -> float:
        return float(np.sum(self.predictions.T * self.factor(information)))
