"""An identification as the journal keeps it: all that follows from it needs no other computation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from hexacell.cell.fields import GeometryDocument
from hexacell.identification.solver.levenberg_marquardt import Termination
from hexacell.identification.solver.result import DataFaultKind
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array
from procedures.run.steps import Frozen, ThreeNumbers


class OutlierRecord(Frozen):
    """A record that was left out.

    ``gauges`` are those that alone are wrong, and ``off_mm`` what the gauges x, y and z show too much.
    """

    point: int
    orientation: int
    kind: DataFaultKind = DataFaultKind.GROSS_ERROR
    gauges: tuple[str, ...] = ()
    off_mm: ThreeNumbers | None = None


@dataclass(frozen=True, slots=True, eq=False)
class KeptEstimate:
    """A :class:`~hexacell.identification.solver.result.GeometryEstimate` from the journal."""

    geometry: Geometry
    sigma: Array
    termination: Termination
    undetermined: tuple[str, ...]


class IdentificationResult(Frozen):
    """The identified geometry and how certain it is, as in ``result.json``."""

    converged: bool
    termination: Termination
    iterations: int
    records: int
    points: int
    residual_rms_mm: float
    chi2: float
    dof: int
    geometry: GeometryDocument
    sigma: GeometryDocument
    covariance: tuple[tuple[float, ...], ...]
    undetermined: tuple[str, ...]
    outliers: tuple[OutlierRecord, ...]
    frame: str

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """The result in :func:`~hexacell.reporting.documents.identification_document`."""
        return cls.model_validate({name: document[name] for name in cls.model_fields})

    def estimate(self, parameters: ParameterSet) -> KeptEstimate:
        """What the acceptance gates need."""
        sigma = parameters.vector(self.sigma)
        return KeptEstimate(self.identified(parameters), sigma, self.termination, self.undetermined)

    def identified(self, parameters: ParameterSet) -> Geometry:
        """The geometry in the mechanism's frame convention."""
        return Geometry.of(parameters, self.geometry)
