"""What passive joints and legs allow: cones about the joints' axes, and a smallest distance; batched.

A passive joint (ball joint or universal joint) lets a leg turn within a cone about an axis that is fixed to
what carries the joint: at one end the slider, which does not turn, or the crank, at the other the platform.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.kinematics.compiled.availability import is_compiled, own
from hexacell.kinematics.leg_closure import LegClosure
from hexacell.kinematics.legs import PARALLEL, Legs, angles_between
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

ROUNDING = 1e-9
"""Of an angle, rad, or a length, mm: a pose at a limit is within it."""

_NO_TURNS = np.tile(np.eye(3), (1, 6, 1, 1))
"""Carriers that do not turn."""


@dataclass(frozen=True, slots=True, eq=False)
class LegLimits:
    """What passive joints and legs allow.

    Attributes:
        base_axes: (6, 3) unit vectors about which the base's passive joints turn: in the base frame, or
            in that of the crank which carries the joint.
        platform_axes: (6, 3) those of the platform's joints, in the platform frame.
        base_cones: (6,) largest angles of the legs from these axes, rad.
        platform_cones: (6,) those at the platform, rad.
        distance_mm: smallest distance of two legs; 0 is no limit, and has no margin. Below it, where limits
            were widened, everything is allowed, with a margin.
    """

    base_axes: Array
    platform_axes: Array
    base_cones: Array
    platform_cones: Array
    distance_mm: float

    def spare_angles(self, legs: Legs) -> Array:
        """Angles (n, 2, 6), rad, that passive joints have left, at the base and at the platform."""
        at_base = self.base_cones - angles_between(legs.directions_in_carriers, self.base_axes)
        at_platform = self.platform_cones - angles_between(legs.directions_in_platform, self.platform_axes)
        spare = np.empty((len(at_base), 2, 6))
        spare[:, 0], spare[:, 1] = at_base, at_platform
        return spare

    def margins(self, legs: Legs) -> Array:
        """By how much n poses keep these limits, (n, m), negative beyond them.

        The spare angles of the passive joints, rad, then the legs' spare distance, mm, if it has a limit.
        """
        if is_compiled():
            return self._margins_compiled(legs)
        angles = self.spare_angles(legs).reshape(-1, 12)
        if self.distance_mm == 0.0:
            return angles
        return np.column_stack([angles, legs.smallest_distance() - self.distance_mm])

    def keeps(self, legs: Legs, wanted: Array | float = 0.0) -> Mask:
        """At which of n poses all :meth:`margins` are at least those wanted (m,).

        Distances take most of the time, and the platform's joints limit most, so that each is computed only
        where those before it are kept.
        """
        least = self._least(wanted)
        if is_compiled():
            return self._keeps_compiled(legs, least)
        directions = legs.directions
        at_platform = angles_between(directions @ legs.rotations, self.platform_axes)
        kept = np.asarray((self.platform_cones - at_platform >= least[6:12]).all(axis=-1))
        legs = legs[kept]
        at_base = angles_between(legs.in_carriers(directions[kept]), self.base_axes)
        are_free = np.asarray((self.base_cones - at_base >= least[:6]).all(axis=-1))
        if self.distance_mm != 0.0:
            are_free[are_free] = legs[are_free].smallest_distance() - self.distance_mm >= least[12]
        kept[kept] = are_free
        return kept

    def keeps_closed(self, closure: LegClosure, poses: PoseBatch, wanted: Array | float = 0.0) -> Mask:
        """:meth:`keeps` of n poses by a closure whose carriers do not turn; compiled."""
        # Only where numba is installed.
        from hexacell.kinematics.compiled.leg_margins import keeps_at  # noqa: PLC0415

        kept = np.empty(len(poses), dtype=bool)
        arrays = *_closed(closure, poses), *self._reduced(self._least(wanted))
        keeps_at(*arrays, PARALLEL, kept)
        return kept

    def margins_closed(self, closure: LegClosure, poses: PoseBatch) -> Array:
        """:meth:`margins` of n poses by a closure whose carriers do not turn; compiled."""
        # Only where numba is installed.
        from hexacell.kinematics.compiled.leg_margins import margins_at  # noqa: PLC0415

        found = np.empty((len(poses), 12 + (self.distance_mm != 0.0)))
        arrays = *_closed(closure, poses), *self._as_they_are
        margins_at(*arrays, PARALLEL, found)
        return found

    def _keeps_compiled(self, legs: Legs, least: Array) -> Mask:
        # Only where numba is installed.
        from hexacell.kinematics.compiled.leg_margins import keeps  # noqa: PLC0415

        kept = np.empty(len(legs.rotations), dtype=bool)
        arrays = *_arrays(legs), *self._reduced(least)
        keeps(*arrays, PARALLEL, kept)
        return kept

    def _margins_compiled(self, legs: Legs) -> Array:
        # Only where numba is installed.
        from hexacell.kinematics.compiled.leg_margins import margins  # noqa: PLC0415

        found = np.empty((len(legs.rotations), 12 + (self.distance_mm != 0.0)))
        arrays = *_arrays(legs), *self._as_they_are
        margins(*arrays, PARALLEL, found)
        return found

    def _least(self, wanted: Array | float) -> Array:
        """The margins (m,) that are wanted."""
        least: Array = np.zeros(12 + (self.distance_mm != 0.0)) + wanted
        return least

    def _reduced(self, least: Array) -> tuple[Array, Array, Array, Array, float]:
        """Axes, cones and distance for compiled loops, with margins (m,)."""
        distance = float(self.distance_mm + least[12]) if self.distance_mm != 0.0 else 0.0
        cones = self.base_cones - least[:6], self.platform_cones - least[6:12]
        return own(self.base_axes), own(self.platform_axes), *cones, distance

    @property
    def _as_they_are(self) -> tuple[Array, Array, Array, Array, float]:
        """The same without margins."""
        cones = own(self.base_cones), own(self.platform_cones)
        return own(self.base_axes), own(self.platform_axes), *cones, float(self.distance_mm)

    def margins_for(self, turn: float, radius_mm: float) -> Array:
        """Margins (m,) that hold should a platform of some radius turn by an angle, rad."""
        turns = np.full(12, turn)
        return turns if self.distance_mm == 0.0 else np.append(turns, turn * radius_mm)

    def including(self, margins: Array, wanted: Array | float = 0.0) -> LegLimits:
        """These limits, widened where the :meth:`margins` (m,) at a pose are less than wanted (m,)."""
        missing = np.maximum(0.0, wanted - margins + ROUNDING)
        if not missing.any():
            return self
        distance = self.distance_mm - float(missing[12:].sum())
        return replace(
            self,
            base_cones=self.base_cones + missing[:6],
            platform_cones=self.platform_cones + missing[6:12],
            distance_mm=distance if distance or not self.distance_mm else -ROUNDING,
        )


def _arrays(legs: Legs) -> tuple[Array, Array, Array, Array]:
    """What compiled loops take of the legs."""
    carriers = _NO_TURNS if legs.carriers is None else legs.carriers
    return own(legs.base_joints), own(legs.platform_joints), own(legs.rotations), own(carriers)


def _closed(closure: LegClosure, poses: PoseBatch) -> tuple[Array, Array, Array, Array, Array]:
    """The same of poses, with the closure of their legs."""
    return *closure.joint_arrays(), own(poses.positions), own(poses.rotations), _NO_TURNS
