"""What a controller adds to its inverse kinematics for what is not geometry.

A joint is sent half its backlash further in the direction in which it arrives. The inverse kinematics is
that of legs as long as play and compliance make them under the weight: a leg that is pulled is longer by
half its play, and by its compliance times its force.
"""

from dataclasses import dataclass

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]

NONE: Six = (0.0,) * 6


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
        """The coefficients for a term of the model, by its name."""
        by_name = {"backlash": self.backlash, "play": self.play_mm, "compliance": self.compliance_um_n}
        return by_name[term]

    @property
    def are_none(self) -> bool:
        """Whether nothing is corrected."""
        return not any((*self.backlash, *self.play_mm, *self.compliance_um_n))


NO_CORRECTIONS = Corrections()
