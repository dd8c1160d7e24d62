"""5-UPS/PRPU: five legs of variable length and a passive leg, for machines with five axes.

The driven legs close as those of a Gough-Stewart platform. The passive leg has a slide along base x, a
joint that turns about x, another slide, and a universal joint: its first axis is parallel to x, its second
is y of the platform. So that stays square to base x, and everything else is free. The platform has all
three translations, it tilts about x and about its own y, and how far it turns about z follows:

    e_x . R e_y = sin s,    tan c = sin b tan a    where s = 0.

**Frames.** The slide is x of the base frame, the universal joint's second axis y of the platform's. Each
may still be turned about that axis, and the base frame shifted: 36 numbers, 31 of them free. Joint 1 on the
base is the origin, joint 3 at z = 0 there, and joints 1 and 3 on the platform at one height.

Sources: Merlet, Parallel Robots, 2nd ed. 2006 (UPS legs, passive chains); 5-UPS/PRPU is the name of this
arrangement in the literature on parallel machine tools. The equation of the passive leg follows from its
joints.
"""

from dataclasses import replace

import numpy as np

from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.legs import CLOSEST_JOINTS_MM
from hexacell.kinematics.mechanism import FrameConvention, FrameFreedom, MechanismWords
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS, GoughStewart
from hexacell.kinematics.mechanisms.held_directions import HeldDirections
from hexacell.kinematics.parameters import ParameterKind, ParameterSet, ParameterUnit, each_of
from hexacell.kinematics.pose import FrameTransform
from hexacell.kinematics.rotations import Array

LEGS = 5

FIVE_LEGS_PARAMETERS = ParameterSet(
    (
        *(replace(kind, owners=each_of(LEGS)) for kind in GOUGH_STEWART_PARAMETERS.kinds),
        ParameterKind(
            "skew",
            (),
            meaning="angle by which the axes of the passive leg are not square, rad",
            tolerance_meaning="that angle",
            unit=ParameterUnit.RAD,
            default_tolerance=0.002,
            display="passive leg skew",
            owners=((LEGS,),),
        ),
    ),
    has_branch=False,
)

PASSIVE_LEG_FRAME = FrameConvention(
    name="passive leg; joints of legs 1 and 3",
    parameters=FIVE_LEGS_PARAMETERS,
    zero=("base1x", "base1y", "base1z", "base3z"),
    equal=(("platform1z", "platform3z"),),
)


class FiveLegs(HeldDirections, GoughStewart):
    """5-UPS/PRPU."""

    name = "five-legs"
    words = MechanismWords(
        "five-legged machine",
        joint="leg",
        never_seen="where the passive leg is and how its slides run, as it holds a direction only: nothing "
        "at its work depends on it",
    )
    parameters = FIVE_LEGS_PARAMETERS
    convention = PASSIVE_LEG_FRAME
    frame_freedom = FrameFreedom(base="x", platform="y")
    coordinates = "xyzab"
    held, skew = ((0, 1),), "skew"

    def convention_frames(self, geometry: Geometry) -> FrameTransform:
        """Joint 3 beside joint 1 on the base, both at one height on the platform."""
        base, platform = geometry["base"], geometry["platform"]
        beside, along = (base[2] - base[0])[1:], (platform[2] - platform[0])[[2, 0]]
        y, z = _unit(beside, "base")
        sine, cosine = _unit(along, "platform")
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, y, z], [0.0, -z, y]])
        about_y = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        return FrameTransform(about_x, base[0].copy(), about_y)


def _unit(vector: Array, part: str) -> Array:
    if (size := np.linalg.norm(vector)) < CLOSEST_JOINTS_MM:
        problem = f"the {part} joints of legs 1 and 3 that fix the frame are in one line"
        raise UsageError(problem, action="Correct the joints, or number the legs otherwise")
    return vector / size
