"""The section of the fixture with two seats, whose known distance checks the scale of all encoders."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from hexacell.cell.fields import (
    CertificateSettings,
    InRange,
    NotNegative,
    PointInRange,
    Positive,
    Section,
    Text,
    broken_rule,
    key,
)

MicrometresPerMetreKelvin = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
COARSEST_SHARE = 1e-3
"""Largest expanded uncertainty of the distance, over it: beyond, the certificate is in another unit."""


class LengthCheckSettings(Section):
    """A fixture with two parallel seats for the gauges, a certified distance apart."""

    first_seat: PointInRange = key(..., "position of the ball in the first seat, mm, in the base frame")
    direction: PointInRange = key(
        (1.0, 0.0, 0.0),
        "direction from the first seat to the second; a way on which all joints move alike is best",
    )
    distance_mm: float = key(..., "certified distance of the two places of the ball, mm", ge=20, le=5000)
    uncertainty_mm: Positive = key(..., "certified expanded uncertainty (k = 2) of that distance, mm")
    certificate: CertificateSettings | None = key(None, "certificate of that distance")
    parallel_mrad: NotNegative = key(0.1, "angle between the seats about each axis, mrad, 1 sigma", le=20)
    height_mm: NotNegative = key(
        50.0, "height of the ball above the line along which the distance is certified, mm; 0: at the ball"
    )
    seating_um: NotNegative = key(
        5.0, "scatter of the gauges in a seat, from one mounting to the next, um, 1 sigma", le=1000
    )
    certified_at_c: InRange = key(20.0, "temperature for which the certificate holds, deg C")
    temperature_c: InRange = key(20.0, "temperature of the fixture, deg C, where no thermometer shows it")
    thermometer: Text | None = key(None, "name of the thermometer on the fixture")
    temperature_sigma_k: NotNegative = key(1.0, "uncertainty of that temperature, K, 1 sigma", le=50)
    expansion_um_m_k: MicrometresPerMetreKelvin = key(
        11.5, "thermal expansion of the fixture, um/m/K: steel 11.5, aluminium 23, Invar 1.5"
    )
    repeats: int = key(1, "how often the second seat is measured", ge=1, le=20)
    orientations: int = key(
        5, "orientations of the platform with the ball in the middle of a seat", ge=1, le=25
    )
    tilt_deg: Positive = key(10.0, "tilt of all orientations but the first, which is level, deg", le=45)
    mounting: Literal["by-hand", "fixed"] = key(
        "by-hand", "how the gauges come into the seats: by-hand, or fixed where no person is needed"
    )

    @property
    def second_seat(self) -> tuple[float, float, float]:
        """Where the ball is measured in the second seat, mm, in the base."""
        first, towards = np.array(self.first_seat), np.array(self.direction)
        x, y, z = (first + self.distance_mm * towards / np.linalg.norm(towards)).tolist()
        return x, y, z

    @property
    def mountings(self) -> int:
        """How often the gauges are mounted: in the first seat before and after each time in the second."""
        return 2 * self.repeats + 1

    @model_validator(mode="after")
    def _the_distance_has_a_direction(self) -> Self:
        if not np.linalg.norm(self.direction) > 1e-6:
            raise broken_rule(
                "direction has no length", "Write the base axis from seat to seat, as [1, 0, 0]"
            )
        return self

    @model_validator(mode="after")
    def _the_certificate_is_better_than_a_ruler(self) -> Self:
        largest = COARSEST_SHARE * self.distance_mm
        if self.uncertainty_mm > largest:
            raise broken_rule(
                f"uncertainty_mm is {self.uncertainty_mm:g}, more than {largest:g} (0.1 % of distance_mm)",
                "Write the expanded uncertainty of the certificate, in mm",
            )
        return self
