"""What an identification found, how sure it is, and what it could not tell."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import Termination
from hexacell.kinematics.geometry import PARAMETER_NAMES, Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

UNDETERMINED_RATIO = 0.5
"""A standard deviation that measuring has not even halved is the drawing's, not the data's."""


GAUGES = "xyz"


class DataFaultKind(StrEnum):
    """What is wrong."""

    GROSS_ERROR = "gross error"
    EXCHANGED = "exchanged gauges"
    REVERSED = "reversed gauge"
    INCHES = "inches"
    SLIPPED_ZERO = "slipped zero"
    FOREIGN_JOINTS = "joint variables of another pose"
    SINGULAR = "next to a singularity"


@dataclass(frozen=True, slots=True)
class DataFault:
    """Records that do not agree with the others, and why.

    Attributes:
        kind: what is wrong with them.
        point: at which point; none where it is every point.
        orientation: which record of the point; the first one after a slip; none where it is all.
        gauges: the gauges concerned, of ``xyz``; empty where no single one stands out.
        sentence: all that for people.
        action: the next thing to do.
    """

    kind: DataFaultKind
    point: int | None
    orientation: int | None
    gauges: str
    sentence: str
    action: str

    def __str__(self) -> str:
        return f"{self.sentence}. {self.action}."


class GaugeFaultError(IdentifiabilityError):
    """Readings that are wrong in a known way; a geometry fitted to them would be wrong too."""

    def __init__(self, anomaly: DataFault) -> None:
        self.anomaly = anomaly
        super().__init__(anomaly.sentence, action=anomaly.action)


@dataclass(frozen=True, slots=True)
class Outlier:
    """A record that does not agree with the others, and is left out.

    Attributes:
        statistic: squared length of its standardised residual; about 3 for a good record, infinite
            for one that the identified geometry cannot follow at all.
        kind: what is wrong with it.
        gauges: of ``xyz``, those that alone are wrong; empty where no single one stands out.
        off_mm: what the gauges x, y and z show too much; none where that cannot be said.
        stray: the leg (from 1) that does not stand where it was sent, and how far off, mm.
    """

    point: int
    orientation: int
    statistic: float
    kind: DataFaultKind = DataFaultKind.GROSS_ERROR
    gauges: str = ""
    off_mm: tuple[float, float, float] | None = None
    stray: tuple[int, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """The identified geometry and everything said about it.

    Attributes:
        geometry: in the mechanism's frame convention, mm.
        covariance: (42, 42), mm^2, in that convention; zero for what it fixes.
        free: the free parameters (p,), mm, and ``free_covariance`` (p, p) theirs.
        prior_sigma: (42,), mm, before measuring.
        problem: the records that were used.
        poses: the platform at each of them, under the identified geometry.
        residual_rms_mm: of the centred residuals of the deviations.
        chi2: weighted sum of squares of those residuals, to be compared with ``dof``.
        outliers: the records left out, and ``anomalies`` why, in words.
    """

    geometry: Geometry
    covariance: Array
    free: Array
    free_covariance: Array
    prior_sigma: Array
    problem: Problem
    poses: PoseBatch
    residual_rms_mm: float
    chi2: float
    dof: int
    iterations: int
    termination: Termination
    outliers: tuple[Outlier, ...]
    frame: str
    anomalies: tuple[DataFault, ...] = ()

    @property
    def records(self) -> int:
        """How many records were used."""
        return self.problem.records

    @property
    def points(self) -> int:
        """At how many points."""
        return self.problem.points

    @property
    def converged(self) -> bool:
        """Whether the solver ended at a solution."""
        return self.termination.converged

    @property
    def sigma(self) -> Array:
        """Standard deviations (42,), mm, of the parameters; zero for what the convention fixes."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters about which the data said next to nothing: posterior against prior."""
        silent = self.sigma > UNDETERMINED_RATIO * self.prior_sigma
        return tuple(
            name
            for name, prior, said_nothing in zip(PARAMETER_NAMES, self.prior_sigma, silent, strict=True)
            if prior > 0.0 and said_nothing
        )
