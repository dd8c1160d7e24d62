"""Section ``[robot]``: the mechanism, its drawing, and what else is stated of its legs."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, model_validator

from hexacell.cell.fields import (
    GeometrySettings,
    InRange,
    PointInRange,
    Section,
    Six,
    Text,
    broken_rule,
    key,
)
from hexacell.kinematics.encoder_scales import WithEncoderScales
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS
from hexacell.kinematics.mechanisms.screw_legs import ScrewLegs, Screws
from hexacell.plugins import Group, load

DEFAULT_MECHANISM = "hexaglide"
SCREW_MECHANISM = "gough-stewart"


def _a_direction(vector: PointInRange) -> PointInRange:
    if not any(vector):
        raise broken_rule("0, 0, 0 is no direction", "Write the direction of the joint's axis")
    return vector


Direction = Annotated[PointInRange, AfterValidator(_a_direction)]


class ScrewSettings(Section):
    """Screws that are not held against turning, in legs between universal joints."""

    lead_mm: InRange = key(..., "lead of the screws, mm a turn; below zero for left-handed threads")
    base_axes: Six[Direction] = key(
        ..., "axes of the joints on the base that the legs turn about, in the base frame, legs 1 to 6"
    )
    platform_axes: Six[Direction] = key(
        ...,
        "axes of the joints on the platform that the legs turn about, in the platform frame, legs 1 to 6",
    )


class RobotSettings(Section):
    """The mechanism and its drawing."""

    mechanism: Text = key(
        DEFAULT_MECHANISM,
        "name of the mechanism: hexaglide, gough-stewart, six-rails, rotary-cranks, or one that a "
        "plug-in adds",
    )
    nominal: GeometrySettings = key(..., "geometry by the drawing, with which identification starts")
    encoder_scales: bool = key(
        False,
        "whether errors of the encoders' scales are identified too: encoder_scale in drawing, tolerances "
        "and the controller's config, which needs a place for them",
    )
    screws: ScrewSettings | None = key(
        None, "screws of a Gough-Stewart platform whose legs may turn in their nuts"
    )

    @model_validator(mode="after")
    def _screws_are_legs(self) -> Self:
        if self.screws is not None and self.mechanism != SCREW_MECHANISM:
            raise broken_rule(
                f"the legs of {self.mechanism} are no screws",
                f'Remove [robot.screws], or write mechanism = "{SCREW_MECHANISM}"',
            )
        return self

    def built(self) -> Mechanism:
        """The mechanism, with what is stated of it; raises ``UsageError`` if it is not installed."""
        if self.screws is None:
            return mechanism_of(self.mechanism, encoder_scales=self.encoder_scales)
        drawn = self.nominal.model_dump()
        return _screw_legs(
            self.screws, drawn["base"], drawn["platform"], encoder_scales=self.encoder_scales
        )


@cache
def mechanism_named(name: str) -> Mechanism:
    """The mechanism that is announced under a name; raises ``UsageError`` if it is not installed."""
    found: Mechanism = load(Group.MECHANISMS, name)()
    return found


@cache
def mechanism_of(name: str, *, encoder_scales: bool) -> Mechanism:
    """The mechanism with this name, with errors of the encoders' scales if these are identified."""
    return _with_scales(mechanism_named(name), encoder_scales=encoder_scales)


def _with_scales(mechanism: Mechanism, *, encoder_scales: bool) -> Mechanism:
    return WithEncoderScales(mechanism) if encoder_scales else mechanism


@cache
def _screw_legs(
    settings: ScrewSettings, base: Six[PointInRange], platform: Six[PointInRange], *, encoder_scales: bool
) -> Mechanism:
    """The mechanism with joints that are drawn on base and platform there, mm."""
    screws = Screws(settings.lead_mm, np.array(settings.base_axes), np.array(settings.platform_axes))
    drawn: dict[str, ArrayLike] = {"base": base, "platform": platform, "offset": np.zeros(6)}
    legs = ScrewLegs(screws, Geometry.of(GOUGH_STEWART_PARAMETERS, drawn))
    return _with_scales(legs, encoder_scales=encoder_scales)
