"""The result of an identification as data, for files and for the journal.

The acceptance gates and the write-back are derived from it without further computation.
"""

from datetime import datetime
from typing import Any, Self

import numpy as np
from pydantic import Field

from hexacell.cell.fields import Frozen, GeometryDocument
from hexacell.identification.data_faults.outlier_statistics import OutlierStatistics
from hexacell.identification.identified_zeros import IdentifiedZeros, ParameterChoice
from hexacell.identification.solver import result
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MEASURED_PARTS, Deviation, RecordId, Temperatures
from hexacell.results.term_result import TermResult, term_results
from hexacell.uncertainty.statement import COVERAGE_FACTOR


class OutlierRecord(Frozen):
    """A record that was left out.

    ``gauges`` are those that alone are wrong, and ``off_mm`` what the gauges x, y and z show too much.
    """

    point: int
    orientation: int
    kind: result.DataFaultKind = result.DataFaultKind.GROSS_ERROR
    gauges: tuple[str, ...] = ()
    off_mm: Deviation | None = None

    @classmethod
    def of(cls, record: RecordId, fault: result.DataFault) -> Self:
        """A record and its fault as an outlier; the gauges of a zero shift are in its finding only."""
        point, orientation = record
        gauges = () if fault.kind is result.DataFaultKind.ZERO_SHIFT else tuple(fault.gauges)
        return cls(
            point=point, orientation=orientation, kind=fault.kind, gauges=gauges, off_mm=fault.offset_mm
        )


class RecordResidual(Frozen):
    """What a record shows more than the identified geometry explains, along the gauges x, y and z.

    ``sigmas`` is the largest of the three in standard deviations of what the noise leaves of it.
    """

    point: int
    orientation: int
    mm: Deviation
    sigmas: float

    @classmethod
    def of_records(cls, found: result.Identification) -> tuple[Self, ...]:
        """Of all records that were used."""
        model = found.linear_model
        along = -model.residuals @ model.problem.gauges
        sigmas = np.sqrt(OutlierStatistics.of(model).along_gauges.max(axis=-1))
        return tuple(
            cls(point=point, orientation=orientation, mm=(x, y, z), sigmas=size)
            for (point, orientation), (x, y, z), size in zip(
                model.problem.labels.tolist(), along.tolist(), sigmas.tolist(), strict=True
            )
        )


class IdentificationResult(Frozen):
    """The identified geometry and its uncertainty: the first part of ``result.json``.

    ``expected_chi2`` is the mean of ``chi2`` if model and noise are right: ``dof``, and more where
    tolerances or an earlier result determine parameters. Older journals have it for the latter only, else
    None. ``identifies`` says which parameters are identified; the others are as the controller has them,
    with their tolerances as sigma. ``terms`` are those beside the geometry that the records were searched
    for; older journals have none. ``holds_at_c`` are the temperatures of legs and base for which it does,
    None of a part without; empty if no record has any.
    """

    converged: bool
    termination: result.Termination
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
    expected_chi2: float | None = None
    noise_freedom: float | None = None
    identifies: ParameterChoice = ParameterChoice.ALL
    terms: tuple[TermResult, ...] = ()
    holds_at_c: Temperatures = ()

    @classmethod
    def of(cls, found: result.Identification, zeros: IdentifiedZeros | None = None) -> Self:
        """The result of an identification, or of the zeros alone."""
        parameters, kept = found.geometry.parameters, zeros or found
        holds_at = found.problem.holds_at
        return cls(
            converged=found.termination.converged,
            termination=found.termination,
            iterations=found.solution.iterations,
            records=found.records,
            points=found.problem.points,
            residual_rms_mm=found.residual_rms_mm,
            chi2=found.goodness.chi2,
            dof=found.dof,
            geometry=parameters.document(kept.geometry.vector),
            sigma=parameters.document(kept.sigma),
            covariance=kept.covariance.tolist(),
            undetermined=kept.undetermined,
            outliers=tuple(OutlierRecord.of(record, fault) for record, fault in found.left_out),
            frame=found.problem.mechanism.convention.name,
            expected_chi2=found.goodness.expected,
            noise_freedom=None if np.isinf(found.problem.noise.freedom) else found.problem.noise.freedom,
            identifies=ParameterChoice.ALL if zeros is None else ParameterChoice.ZEROS,
            terms=term_results(found),
            holds_at_c=holds_at if any(one is not None for one in holds_at) else (),
        )

    def document(self, parameters: ParameterSet) -> dict[str, Any]:
        """The result as a JSON document, with a row for each of the ``parameters`` in order."""
        values, sigmas = parameters.vector(self.geometry), parameters.vector(self.sigma)
        rows = [
            {
                "name": parameter.name,
                "kind": parameter.kind.symbol,
                "leg": parameter.leg,
                "unit": parameter.kind.unit.value,
                "value": value,
                "sigma": sigma,
            }
            for parameter, value, sigma in zip(
                parameters.parameters, values.tolist(), sigmas.tolist(), strict=True
            )
        ]
        return self.model_dump(mode="json") | {"parameters": rows}

    def estimate(self, parameters: ParameterSet) -> result.GeometryEstimate:
        """What the acceptance gates need."""
        covariance = np.array(self.covariance)
        return result.GeometryEstimate(self.identified(parameters), covariance, self.termination)

    @property
    def residuals(self) -> ChiSquareTest:
        """The chi-square test of the residuals."""
        return ChiSquareTest(
            self.chi2,
            float(self.dof) if self.expected_chi2 is None else self.expected_chi2,
            np.inf if self.noise_freedom is None else self.noise_freedom,
        )

    def identified(self, parameters: ParameterSet) -> Geometry:
        """The geometry in the mechanism's frame convention."""
        return Geometry.of(parameters, self.geometry)


def legs_at(temperatures_c: Temperatures) -> str:
    """The temperatures of legs in words: "legs at 20.0 to 21.5 deg C"; empty where none is known."""
    of_legs = temperatures_c[: MEASURED_PARTS - 1]
    if not (known := [celsius for celsius in of_legs if celsius is not None]):
        return ""
    lowest, highest = (f"{limit(known):.1f}" for limit in (min, max))
    return f"legs at {lowest if lowest == highest else f'{lowest} to {highest}'} deg C"


class ExpectedImprovement(Frozen):
    """The largest position error over the task poses, mm.

    Attributes:
        now_mm: of the controller's geometry, as the identification has it.
        expanded_mm: U of the identified geometry.
    """

    now_mm: float
    expanded_mm: float


class LengthSource(Frozen):
    """A line of the budget of a length check: one standard deviation of the scale."""

    name: str
    um_m: float


class LengthResult(Frozen):
    """The scale common to all encoders, as a length check found it.

    Attributes:
        distance_mm: certified, at the temperature of the fixture.
        length_mm: by the robot.
        long_um_m: by how much the encoders show more than that; negative if they show less.
        expanded_um_m: its expanded uncertainty U, k = 2.
        stated_um_m: one standard deviation of the scale by the cell file.
        sources: what the uncertainty consists of.
        is_consistent: whether the records agree with each other; otherwise the check has no result.
        reason: why they do not, empty if they do.
    """

    distance_mm: float
    length_mm: float
    long_um_m: float
    expanded_um_m: float
    stated_um_m: float
    sources: tuple[LengthSource, ...]
    is_consistent: bool
    reason: str = ""

    @property
    def is_significant(self) -> bool:
        """Whether the encoders are certainly not true to scale."""
        return self.is_consistent and abs(self.long_um_m) > self.expanded_um_m

    @property
    def replaces_stated(self) -> bool:
        """Whether the check says more than the cell file: it is finer, or it contradicts it."""
        sigma = self.expanded_um_m / COVERAGE_FACTOR
        contradicts = abs(self.long_um_m) > COVERAGE_FACTOR * np.hypot(sigma, self.stated_um_m)
        return self.is_consistent and bool(contradicts or sigma < self.stated_um_m)

    @property
    def factor(self) -> float:
        """What the scale factor of all encoders must be multiplied by."""
        return 1.0 / (1.0 + 1e-6 * self.long_um_m)


class AcceptedResult(Frozen):
    """A result whose geometry the controller has: it passed, or a person kept it.

    Attributes:
        run: the folder of its run.
        at: when that ended.
        covariance: of the parameters, mm^2, in the mechanism's frame convention.
        effects: what one unit of each cause of a systematic effect did to the free parameters: by the
            name of the effect, a row a cause.
        length: what the length check of its run found; None without one.
        leg_temperatures_c: of legs, and of the base, at which the geometry holds; by older journals means
            of legs while it was measured. None for one without a thermometer that answered.
        identified: the geometry in the mechanism's frame convention, where the controller got another one;
            None where it has this one.
        terms: those beside the geometry that the robot has.
    """

    run: str
    at: datetime
    covariance: tuple[tuple[float, ...], ...]
    effects: dict[str, tuple[tuple[float, ...], ...]] = Field(default_factory=dict)
    length: LengthResult | None = None
    leg_temperatures_c: tuple[float | None, ...] = ()
    identified: GeometryDocument | None = None
    terms: tuple[TermResult, ...] = ()

    @property
    def parameter_columns(self) -> dict[str, Array]:
        """Errors (p, k) of the free parameters, by the name of the effect."""
        return {name: np.array(rows).T for name, rows in self.effects.items()}
