"""The interface of a mechanism: six constraints, their derivatives, and its frames.

A constraint is that of a leg with a joint variable. Where there are fewer than six of these, passive joints
hold the platform in what is missing, and the last constraints, which have no joint variable, are theirs.
The robot then has as many coordinates as joints. The other angles of its poses follow from the passive
constraints (:meth:`Mechanism.completed`).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import ReachError
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.parameters import GeometricParameter, JointUnit, ParameterSet
from hexacell.kinematics.pose import AXES, FrameTransform, Pose, PoseBatch
from hexacell.kinematics.rotations import Array

Sign = Literal[1, -1]
Branch = tuple[Sign, ...]
"""Which of its two inverse solutions each leg is on; empty where a leg has only one."""

STEP = 1e-4
"""Step of differences, mm or rad: a change of frames is nearly linear over it."""


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintDerivatives:
    """First derivatives of the six constraints, which are in mm, at n poses.

    Attributes:
        pose: (n, 6, 6) by the ball's position, mm, then by a rotation vector in the base frame,
            rad, applied from the left.
        joints: (n, J): leg i depends on joint variable i alone, in its unit.
        parameters: (n, 6, c): a constraint depends on its own numbers alone, in the order of the kinds; 0
            where it has fewer than c.
    """

    pose: Array
    joints: Array
    parameters: Array


@dataclass(frozen=True)
class FrameConvention:
    """Parameters that the choice of frames sets to zero, and groups that it makes equal.

    The rules are explicit and not derived from the numerical rank of the data's Jacobian, which
    depends on the geometry errors (``docs/method.md``).
    """

    name: str
    parameters: ParameterSet
    zero: tuple[str, ...]
    equal: tuple[tuple[str, ...], ...]

    @cached_property
    def basis(self) -> Array:
        """The (P, p) matrix from the free parameters to all parameters; its entries are 0 and 1."""
        representative = {name: group[0] for group in self.equal for name in group}
        free = self.free_names
        matrix = np.zeros((len(self.parameters), len(free)))
        for row, name in enumerate(self.parameters.names):
            if name not in self.zero:
                matrix[row, free.index(representative.get(name, name))] = 1.0
        matrix.setflags(write=False)
        return matrix

    @cached_property
    def free_names(self) -> tuple[str, ...]:
        """Names of the free parameters; a group of equal parameters has the name of its first."""
        others = {*self.zero, *(name for group in self.equal for name in group[1:])}
        return tuple(name for name in self.parameters.names if name not in others)

    @cached_property
    def free_rows(self) -> NDArray[np.intp]:
        """Indices of the free parameters in a vector (P,) of all parameters."""
        return self.parameters.rows(self.free_names)

    @cached_property
    def further_places(self) -> tuple[tuple[int, int], ...]:
        """Places of derivatives that are added to that of a free parameter, and which free parameter."""
        taken = set(self.parameters.first_places[self.free_rows].tolist())
        columns = [(place, np.flatnonzero(self.basis[row])) for row, place in self.parameters.places]
        return tuple((place, int(one[0])) for place, one in columns if len(one) and place not in taken)

    def free_parameters(self, geometry: Geometry) -> Array:
        """The free parameters (p,) of a geometry in the convention's frames."""
        return geometry.vector[self.free_rows]

    def geometry(self, free: Array) -> Geometry:
        """The geometry of free parameters (p,)."""
        return Geometry(self.parameters, self.basis @ free)

    def display_name(self, name: str) -> str:
        """The name of a parameter in text: "leg 3 length" for ``l3``, "B6 x" for ``B6x``.

        The first of several equal parameters is named together with the others: "B2/B3/B5 z".
        """
        group = next((group for group in self.equal if group[0] == name), (name,))
        members: list[GeometricParameter] = [
            self.parameters.parameters[row] for row in self.parameters.rows(group).tolist()
        ]
        first = members[0]
        joints = "/".join(f"{member.kind.symbol}{member.leg}" for member in members)
        return first.kind.display_name(first.leg, first.component, joints)


@dataclass(frozen=True, slots=True)
class FrameFreedom:
    """The changes of frames that the parameters of a mechanism can express: by which axes.

    Where rails run along base x, for example, no parameters describe the machine in a base frame that is
    turned about y or z. Each attribute has some of the letters of ``xyz``.

    Attributes:
        shift: along which axes of the base frame its origin may be shifted.
        base: about which of them it may be turned.
        platform: about which axes of the platform frame that frame may be turned; its origin is the ball.
        size: whether a machine whose lengths are all larger by a share does the same, and its ball goes
            farther by that share. No joint variable is a length then. It is no choice of frames, and no
            rule takes it: the parameters keep it, and the tolerances alone determine it.
    """

    shift: str = "xyz"
    base: str = "xyz"
    platform: str = "xyz"
    size: bool = False

    @property
    def columns(self) -> list[int]:
        """Which of nine small changes are free: shifts, then turns of the base, then of the platform."""
        kinds = (self.shift, self.base, self.platform)
        return [3 * kind + "xyz".index(axis) for kind, axes in enumerate(kinds) for axis in axes]


@dataclass(frozen=True, slots=True, eq=False)
class Guides:
    """The guides of the sliders at n poses, and what their straightness does to the constraints.

    Attributes:
        rails: the legs, counted from 0, whose sliders share a rail.
        along: (n, J) position of each slider along its rail, mm.
        across: (n, J, 2) derivatives of the constraints by a displacement of the slider's joint across
            its rail, horizontally and vertically.
    """

    rails: tuple[tuple[int, ...], ...]
    along: Array
    across: Array


@dataclass(frozen=True, slots=True)
class MechanismWords:
    """What a mechanism and its parts are called in text.

    Attributes:
        machine: the kind of machine.
        joint: what each joint variable is the position of; text adds the leg, as in "slider 3".
        guide: what the joints move along, with errors of its own; None where there is no such thing.
        joint_unit: of the joint variables, which are places of what slides or angles of what turns.
        never_seen: what no record shows although the machine has it, and what it does at work; empty where
            only frames are not seen.
    """

    machine: str
    joint: str
    guide: str | None = None
    joint_unit: JointUnit = JointUnit.MM
    never_seen: str = ""


class Mechanism(Protocol):
    """A parallel mechanism with J driven legs; all methods are batched over n poses, and do not raise.

    A ``geometry`` is one for all poses, or one for each where a batch is allowed; ``poses`` are n poses,
    and ``joints`` (n, J) joint variables in the unit of the mechanism.

    Attributes:
        coordinates: those of a pose that the robot has, as many as joints, of ``xyzabc``.
    """

    name: str
    words: MechanismWords
    parameters: ParameterSet
    convention: FrameConvention
    frame_freedom: FrameFreedom
    coordinates: str = AXES

    @property
    def joint_count(self) -> int:
        """J, the number of joints that are driven, each with an encoder."""
        return len(self.coordinates)

    def completed(self, geometry: Geometry, poses: PoseBatch) -> PoseBatch:  # noqa: ARG002 - all are free here
        """The poses (n) with those angles that the robot does not have as its passive joints make them."""
        return poses

    def residual_and_jacobian(
        self, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        """The constraints of the legs and their derivatives by the pose, for Newton's method.

        The errors (n, 6), mm, are zero where all legs close; their derivatives (n, 6, 6) are by the ball's
        position, mm, and the rotation vector, rad.
        """

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        """All derivatives of the constraints, off closed poses as well."""

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """The inverse kinematics in closed form: joint variables (n, J); NaN out of a leg's reach.

        ``branch`` is that of each leg; empty for a mechanism without (:attr:`ParameterSet.has_branch
        <hexacell.kinematics.parameters.ParameterSet.has_branch>`).
        """

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """The inverse solution that each leg is on (n, J): -1 or 1; 1 where it has only one."""

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        """The machine in the frames of :attr:`convention`, and the change of frames."""

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        """The machine in other frames."""

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """Changes (P, J) of the parameters that an encoder does too, which shows 1 less on each leg.

        They are in the unit of the joint variables: with the change of a leg and 1 less on its encoder the
        legs close as before, at all poses.
        """

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        """The guides on which sliders move; None for a mechanism whose words have no guide."""

    def legs(self, geometry: Geometries, poses: PoseBatch, joints: Array) -> Legs:
        """The legs in space at n poses."""

    def platform_radius(self, geometry: Geometries) -> Array:
        """Mean distance of the platform joints from the ball, mm; (n,) for a batch. It scales rotations."""


def with_coordinates(mechanism: Mechanism) -> Mechanism:
    """A mechanism, with all six coordinates where its package says nothing of them, as older ones do."""
    if not hasattr(mechanism, "completed"):
        vars(mechanism).update(
            coordinates=AXES, joint_count=len(AXES), completed=lambda _geometry, poses: poses
        )
    return mechanism


def completed_pose(mechanism: Mechanism, geometry: Geometry, pose: Pose) -> Pose:
    """A pose with those angles that the robot does not have as its passive joints make them."""
    if mechanism.joint_count == len(AXES):
        return pose
    return mechanism.completed(geometry, PoseBatch.of([pose])).pose(0)


def joint_zeros(mechanism: Mechanism, geometry: Geometry) -> Array:
    """The encoders' zeros (J,) that a geometry in any frames contains, in the unit of the joint variables.

    A joint variable and the zero together are what does not depend on the encoder: the whole length of a
    Gough-Stewart platform's leg, the place of a slider in the base frame.
    """
    return mechanism.encoder_zeros(geometry).T @ geometry.vector


def inverse_kinematics(mechanism: Mechanism, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
    """The joint variables (n, J) of n poses that are all within reach, in their unit.

    Raises:
        ReachError: a pose is out of a leg's reach; the message names both.
    """
    joints = mechanism.inverse(geometry, branch, poses)
    if np.isnan(joints).any():
        row, leg = np.argwhere(np.isnan(joints))[0]
        raise ReachError(f"leg {leg + 1} cannot reach the pose {poses.pose(row)}")
    return joints


def free_parameter_derivatives(mechanism: Mechanism, geometry: Geometry) -> Array:
    """Derivatives (P, p) of the free parameters by all parameters of a geometry in frames of its own.

    A parameter that the frame convention fixes moves the frames, and with them the others.
    """
    convention, vector = mechanism.convention, geometry.vector

    def free(values: Array) -> Array:
        normal, _ = mechanism.normalize_frames(Geometry(mechanism.parameters, values))
        return convention.free_parameters(normal)

    steps = STEP * np.eye(len(vector))
    return np.array([(free(vector + step) - free(vector - step)) / (2.0 * STEP) for step in steps])
