"""What passive joints and legs allow: cones about the joints' axes, and a smallest distance; batched.

A passive joint (ball joint or universal joint) lets a leg turn within a cone about an axis that is fixed to
what carries the joint: at one end the slider, which does not turn, or the crank, at the other the platform.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.kinematics.compiled.availability import is_compiled
from hexacell.kinematics.legs import PARALLEL, Legs, angles_between
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
        least = np.zeros(12 + (self.distance_mm != 0.0)) + wanted
        if is_compiled():
            return self._keeps_compiled(legs, least)
        at_platform = angles_between(legs.directions_in_platform, self.platform_axes)
        kept = np.asarray((self.platform_cones - at_platform >= least[6:12]).all(axis=-1))
        at_base = angles_between(legs[kept].directions_in_carriers, self.base_axes)
        kept[kept] = (self.base_cones - at_base >= least[:6]).all(axis=-1)
        if self.distance_mm != 0.0:
            kept[kept] = legs[kept].smallest_distance() - self.distance_mm >= least[12]
        return kept

    def _keeps_compiled(self, legs: Legs, least: Array) -> Mask:
        # Only where numba is installed.
        from hexacell.kinematics.compiled.leg_margins import keeps  # noqa: PLC0415

        kept = np.empty(len(legs.rotations), dtype=bool)
        distance = float(self.distance_mm + least[12]) if self.distance_mm != 0.0 else 0.0
        cones = self.base_cones - least[:6], self.platform_cones - least[6:12]
        axes = _own(self.base_axes), _own(self.platform_axes)
        keeps(*_arrays(legs), *axes, *cones, distance, PARALLEL, kept)
        return kept

    def _margins_compiled(self, legs: Legs) -> Array:
        # Only where numba is installed.
        from hexacell.kinematics.compiled.leg_margins import margins  # noqa: PLC0415

        found = np.empty((len(legs.rotations), 12 + (self.distance_mm != 0.0)))
        axes = _own(self.base_axes), _own(self.platform_axes)
        cones = _own(self.base_cones), _own(self.platform_cones)
        margins(*_arrays(legs), *axes, *cones, float(self.distance_mm), PARALLEL, found)
        return found

    def margins_for(self, turn: float, radius_mm: float) -> Array:
        """Margins (m,) that hold should a platform of some radius turn by an angle, rad."""
        turns = np.full(12, turn)
        return turns if self.distance_mm == 0.0 else np.append(turns, turn * radius_mm)

    def including(self, legs: Legs, wanted: Array | float = 0.0) -> LegLimits:
        """These limits, widened where the margins at one pose (1) are less than wanted (m,)."""
        missing = np.maximum(0.0, wanted - self.margins(legs)[0] + ROUNDING)
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
    return _own(legs.base_joints), _own(legs.platform_joints), _own(legs.rotations), _own(carriers)


def _own(values: Array) -> Array:
    """A copy in the one layout that compiled loops take."""
    return np.array(values, dtype=float)
