"""The result of a length check: the scale of all encoders with its uncertainty, and whether it holds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hexacell.cell.fields import Frozen
from hexacell.cell.length_check import LengthCheckSettings
from hexacell.cell.model import CellSettings
from hexacell.identification.solver.chi_square import SMALLEST_PROBABILITY
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot
from hexacell.uncertainty.effects import Effect
from hexacell.uncertainty.encoder_effects import COMMON_SCALE
from hexacell.uncertainty.length_check import LengthCheck
from hexacell.uncertainty.length_errors import JudgedGeometry
from hexacell.uncertainty.length_records import LengthRecords, LengthStandard
from hexacell.uncertainty.statement import COVERAGE_FACTOR

WRONG_WAY = 0.5
"""A gauge that follows the ball by less has another direction than it should have."""


class LengthSource(Frozen):
    """A line of the budget of a length check: one standard deviation of the scale."""

    name: str
    um_m: float


class LengthResult(Frozen):
    """What a length check says of the scale common to all encoders.

    Attributes:
        distance_mm: certified, at the temperature of the fixture.
        length_mm: by the robot.
        long_um_m: by how much the encoders show more than that; negative if they show less.
        expanded_um_m: its expanded uncertainty U, k = 2.
        stated_um_m: one standard deviation of the scale by the cell file.
        sources: what the uncertainty consists of.
        is_consistent: whether the records agree with each other; otherwise the check says nothing.
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

    @classmethod
    def of(cls, check: LengthCheck, stated_um_m: float) -> LengthResult:
        """The result of a check; ``stated_um_m`` is the size of the common scale by the cell file."""
        reason = contradiction(check)
        return cls(
            distance_mm=check.standard.distance_mm,
            length_mm=check.length_mm,
            long_um_m=check.encoders_long_um_m,
            expanded_um_m=check.expanded_um_m,
            stated_um_m=stated_um_m,
            sources=tuple(LengthSource(name=name, um_m=size) for name, size in check.lines.items()),
            is_consistent=not reason,
            reason=reason,
        )

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


def with_measured_scale(effects: Iterable[Effect], length: LengthResult | None) -> tuple[Effect, ...]:
    """Effects as a length check before left them known; ``length`` is its result, if there was one.

    Only where the check says more than the cell file does the scale have its value and its uncertainty.
    """
    if length is None or not length.replaces_stated:
        return tuple(effects)
    sigma, value = length.expanded_um_m / COVERAGE_FACTOR, -length.long_um_m
    return tuple(
        replace(one, size=sigma, value=value, source="length check") if one.name == COMMON_SCALE else one
        for one in effects
    )


@dataclass(frozen=True, slots=True, eq=False)
class LengthMeasurements:
    """What was measured in the two seats.

    Attributes:
        records: their points are the numbers of the mountings.
        celsius: mean temperature of the fixture; none without a thermometer of it.
    """

    records: MeasurementSet
    celsius: float | None = None


def length_check(
    settings: CellSettings,
    robot: Robot,
    geometry: Geometry,
    judged: JudgedGeometry,
    measured: LengthMeasurements,
    effects: Iterable[Effect],
) -> LengthCheck:
    """The check of a geometry, in the frame convention, that commands ``robot``, or nearly that one.

    Raises:
        IdentifiabilityError: the joint variables do not belong to the commanded poses.
    """
    fixture = settings.length_check
    assert fixture is not None  # noqa: S101 - a run without one has no such records
    records = LengthRecords.of(
        robot.mechanism,
        geometry,
        robot.frames.poses(measured.records.poses),
        measured.records.joints,
        robot.frames.deviations(measured.records.deviations),
        measured.records.points,
        robot.frames.base,
    )
    return LengthCheck.of(records, length_standard(fixture, measured.celsius), robot.noise, judged, effects)


def length_standard(fixture: LengthCheckSettings, celsius: float | None = None) -> LengthStandard:
    """The fixture as it is at a temperature; without one, at that of the cell file."""
    warmer = (fixture.temperature_c if celsius is None else celsius) - fixture.certified_at_c
    return LengthStandard(
        distance_mm=fixture.distance_mm * (1.0 + 1e-6 * fixture.expansion_um_m_k * warmer),
        certificate_mm=fixture.uncertainty_mm / COVERAGE_FACTOR,
        temperature_um_m=fixture.expansion_um_m_k * fixture.temperature_sigma_k,
        parallel=1e-3 * fixture.parallel_mrad,
        height_mm=fixture.height_mm,
        seating_mm=1e-3 * fixture.seating_um,
    )


def encoders_read(result: LengthResult) -> str:
    """The scale of the encoders with U, in words."""
    wrong_way = "long" if result.long_um_m >= 0.0 else "short"
    size = f"{abs(result.long_um_m):.0f} +- {result.expanded_um_m:.0f} um/m"
    return f"encoders read {size} {wrong_way}"


def contradiction(check: LengthCheck) -> str:
    """Why the records of a check cannot be what it presupposes; empty if they can."""
    if wrong := _wrong_way(check.following()):
        return wrong
    if check.closure.probability < SMALLEST_PROBABILITY:
        off = ", ".join(f"{axis} {mm:+.3f}" for axis, mm in zip("xyz", check.closure_mm, strict=True))
        return (
            f"back in the first seat the gauges are {off} mm off: they were zeroed in between, or the "
            "fixture or a gauge has moved"
        )
    if check.agreement.probability < SMALLEST_PROBABILITY:
        return f"its records are {check.agreement.ratio:.1f} times as far off as all sources explain"
    return ""


def _wrong_way(following: Mapping[int, Array]) -> str:
    for mounting, followed in following.items():
        gauges = [axis for axis, slope in zip("xyz", followed, strict=True) if slope < WRONG_WAY]
        if gauges:
            runs = "run" if len(gauges) > 1 else "runs"
            return (
                f"at mounting {mounting} gauge {' and '.join(gauges)} {runs} against the ball: the gauges "
                "are the wrong way round in their seat"
            )
    return ""
