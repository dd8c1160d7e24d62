"""H4 with sliders: four arms and an articulated platform, three translations and one rotation.

Each slider carries an arm of two parallel rods, which keeps its end of the platform parallel to the base.
Arms 1 and 2 hold one half of the platform, 3 and 4 the other; a bar is hinged to both and carries the ball.
Nothing tilts, and the bar turns about z. Arm i of half h closes when

    |S_i + q_i e_i - P - R_z(c) B_h| = l_i,

with the hinge B_h of the half, x and y from the ball, and S_i the rods' middle on the slider less their
middle on the half, as seen from the hinge: where they are on the half, and at which height the hinges are,
changes what S_i is and nothing else. The passive constraints are that the rods keep the bar's axis upright.

Where the bar is square to its direction at c = 0, no arm holds it: poses keep away from +-90 deg.

**Frames.** z of both frames is the bar's axis. Each may be turned about it, the base frame shifted:
28 numbers, 23 of them free. S_1 is the origin, S_3 at y = 0, the two hinges at one y.

Sources: Pierrot and Company, H4: a new family of 4-dof parallel robots, AIM 1999 (the platform and its
singularity); the equation above is own.
"""

from dataclasses import replace

import numpy as np

from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import CLOSEST_JOINTS_MM
from hexacell.kinematics.mechanism import FrameConvention, FrameFreedom, MechanismWords
from hexacell.kinematics.mechanisms.held_directions import HeldDirections
from hexacell.kinematics.mechanisms.six_rails import SIX_RAILS_PARAMETERS, SixRails
from hexacell.kinematics.parameters import MachinePart, ParameterKind, ParameterSet, each_of
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array

HALVES = ((0, 1), (2, 3))
"""Arms, counted from 0, of each half of the platform."""

_SLIDER_JOINT, _RAIL, _, _LENGTH = (replace(kind, owners=each_of(4)) for kind in SIX_RAILS_PARAMETERS.kinds)
_HINGE = ParameterKind(
    "B",
    ("x", "y"),
    meaning="hinges of the two halves of the platform in the bar's frame (origin: the ball), mm",
    tolerance_meaning="both coordinates of a hinge",
    part=MachinePart.PLATFORM,
    default_tolerance=1.0,
    has_ball_offset=True,
    owners=HALVES,
)
FOUR_ARMS_PARAMETERS = ParameterSet((_SLIDER_JOINT, _RAIL, _HINGE, _LENGTH))

BAR_FRAME = FrameConvention(
    name="bar; sliders 1 and 3, hinges",
    parameters=FOUR_ARMS_PARAMETERS,
    zero=("S1x", "S1y", "S1z", "S3y"),
    equal=(("B1y", "B2y"),),
)


class FourArms(HeldDirections, SixRails):
    """H4 with sliders."""

    name = "four-arms"
    words = MechanismWords(
        "four-armed robot",
        joint="slider",
        guide="rail",
        never_seen="at which height the hinges are, where arms are on their half of the platform, and how "
        "the bar's axis leans, as the robot turns about that axis only: nothing at its work depends on it",
    )
    parameters = FOUR_ARMS_PARAMETERS
    convention = BAR_FRAME
    frame_freedom = FrameFreedom(base="z", platform="z")
    coordinates = "xyzc"
    held = ((0, 2), (1, 2))

    def platform_joints(self, geometry: Geometries) -> Array:
        def compute() -> Array:
            hinges = geometry["B"]
            upright = np.concatenate([hinges, np.zeros((*hinges.shape[:-1], 1))], axis=-1)
            return np.repeat(upright, 2, axis=-2)

        return geometry.once("joints on the platform", compute)

    def derivatives_at_platform(self, poses: PoseBatch, n: Array) -> Array:
        return super().derivatives_at_platform(poses, n)[..., :2]

    def convention_frames(self, geometry: Geometry) -> FrameTransform:
        """The slider 3 along x of slider 1, the hinges along x."""
        S, B = geometry["S"], geometry["B"]
        return FrameTransform(
            _about_z((S[2] - S[0])[:2], "slider joints"), S[0].copy(), _about_z(B[1] - B[0], "hinges")
        )

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        values = {symbol: geometry[symbol] for symbol in self.parameters.shapes}
        values["S"] = (values["S"] - change.origin) @ change.base.T
        values["B"] = values["B"] @ change.platform[:2, :2].T
        return Geometry.of(self.parameters, values | self.turned(geometry, change))


def _about_z(along: Array, what: str) -> Array:
    """The turn (3, 3) about z after which a vector (2,) points along x."""
    if (size := np.linalg.norm(along)) < CLOSEST_JOINTS_MM:
        problem = f"two {what} that fix the frame are at one place"
        raise UsageError(problem, action="Correct them in the drawing or the config")
    x, y = along / size
    return np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
