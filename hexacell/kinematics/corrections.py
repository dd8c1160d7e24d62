"""What a controller adds to its inverse kinematics for what is not geometry.

A joint is sent half its backlash further in the direction in which it arrives. The inverse kinematics is
that of legs as long as play and compliance make them under the weight: a leg that is pulled is longer by
half its play, and by its compliance times its force.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from hexacell.kinematics.parameters import JointUnit, ParameterUnit

Six = tuple[float, ...]
"""A number for each joint."""

Three = tuple[float, float, float]

NONE: Six = (0.0,) * 6


class CorrectionKind(StrEnum):
    """What is corrected; the values are the names of the model's terms."""

    BACKLASH = "backlash"
    PLAY = "play"
    COMPLIANCE = "compliance"


class CorrectionChange(NamedTuple):
    """One number of the corrections that changes; 0 where it was not, or is no longer, stated."""

    name: str
    unit: str
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class Corrections:
    """Coefficients of each joint or leg, and the weight whose forces the legs have.

    Attributes:
        backlash: lost motion of each joint, in its unit.
        play_mm: difference of each leg's length between pull and push.
        compliance_um_n: of each leg.
        weight_n: of the platform with what it carries.
        weight_direction: where it pulls, a unit vector in the frame of the controller's base.
        weight_centre_mm: where it acts, in its platform frame; None: in the middle of the joints there.
    """

    backlash: Six = NONE
    play_mm: Six = NONE
    compliance_um_n: Six = NONE
    weight_n: float = 0.0
    weight_direction: Three = (0.0, 0.0, -1.0)
    weight_centre_mm: Three | None = None

    def of(self, term: str) -> Six:
        """The coefficients for a term of the model, by its name; zeros where none corrects it."""
        by_name = {"backlash": self.backlash, "play": self.play_mm, "compliance": self.compliance_um_n}
        return by_name.get(term, NONE)

    @property
    def are_none(self) -> bool:
        """Whether nothing is corrected."""
        return not any((*self.backlash, *self.play_mm, *self.compliance_um_n))

    def taking(self, other: "Corrections", kinds: Collection[CorrectionKind]) -> "Corrections":
        """These with some kinds of others, and with their weight if a force is needed for one of them."""
        needs_forces = bool({CorrectionKind.PLAY, CorrectionKind.COMPLIANCE} & {*kinds})
        weight = other if needs_forces else self
        backlash, play_mm, compliance = (
            (other if kind in kinds else self).of(kind) for kind in CorrectionKind
        )
        return Corrections(
            backlash, play_mm, compliance, weight.weight_n, weight.weight_direction, weight.weight_centre_mm
        )

    def numbers(self, joint_unit: JointUnit) -> Iterator[tuple[str, str, float]]:
        """Name, as "backlash of joint 3", unit and value of all; the weight's centre only where stated."""
        mm, no_unit = str(ParameterUnit.MM), str(ParameterUnit.NONE)
        units = {CorrectionKind.BACKLASH: str(joint_unit), CorrectionKind.PLAY: mm}
        for kind in CorrectionKind:
            part = "joint" if kind is CorrectionKind.BACKLASH else "leg"
            for number, value in enumerate(self.of(kind), start=1):
                yield f"{kind} of {part} {number}", units.get(kind, "um/N"), value
        yield "weight", "N", self.weight_n
        for axis, value in zip("xyz", self.weight_direction, strict=True):
            yield f"weight's direction {axis}", no_unit, value
        for axis, value in zip("xyz", self.weight_centre_mm or (), strict=False):
            yield f"weight's centre {axis}", mm, value

    def changes_to(self, after: "Corrections", joint_unit: JointUnit) -> tuple[CorrectionChange, ...]:
        """The numbers that are others in ``after``."""
        every = [*self.numbers(joint_unit)], [*after.numbers(joint_unit)]
        old, new = ({name: value for name, _, value in numbers} for numbers in every)
        units = {name: unit for numbers in every for name, unit, _ in numbers}
        found = (CorrectionChange(one, units[one], old.get(one, 0.0), new.get(one, 0.0)) for one in units)
        return tuple(one for one in found if one.before != one.after)


NO_CORRECTIONS = Corrections()
