"""The closure of six legs as data: what the constraints of most mechanisms come down to.

Leg i closes when the distance from its joint at the base's end, which does not depend on the pose, to its
joint on the platform is its length. A mechanism that is more than that has no such data.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, cast

from hexacell.kinematics.compiled.availability import is_compiled, own
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class LegClosure:
    """Joints and lengths of the legs at n joint vectors; what is one for all of them may lack that axis.

    Attributes:
        base_joints: (n, 6, 3) in the base frame, mm.
        platform_joints: (n, 6, 3) in the platform frame, mm.
        lengths: (n, 6), mm.
        is_quadratic: whether the constraint is ``(|v|^2 - l^2) / 2 l`` of the vector v between the joints,
            or ``|v| - l``.
        carriers_turn: whether what carries the joints at the base's end turns, as cranks do.
    """

    base_joints: Array
    platform_joints: Array
    lengths: Array
    is_quadratic: bool
    carriers_turn: bool = False

    def joint_arrays(self) -> tuple[Array, Array]:
        """Joints as compiled loops take them, with the first axis n or 1."""
        base, platform = own(self.base_joints), own(self.platform_joints)
        return base.reshape(-1, 6, 3), platform.reshape(-1, 6, 3)

    def arrays(self) -> tuple[Array, Array, Array, bool]:
        """What compiled loops take, with the first axis n or 1."""
        return *self.joint_arrays(), own(self.lengths).reshape(-1, 6), self.is_quadratic


class HasLegClosure(Protocol):
    """A mechanism whose constraints are closures of its legs and nothing else."""

    def leg_closure(self, geometry: Geometry | GeometryBatch, joints: Array) -> LegClosure | None:
        """The closure at joint variables (n, 6); none where there is more to it."""
        ...


def closure_to_compile(
    mechanism: object, geometry: Geometry | GeometryBatch, joints: Array
) -> LegClosure | None:
    """The closure for compiled loops; none where these are not used or the mechanism has none."""
    if not is_compiled() or not hasattr(mechanism, "leg_closure"):
        return None
    return cast("HasLegClosure", mechanism).leg_closure(geometry, joints)
