"""What passive joints and legs allow: cones about the joints' axes, and a smallest distance; batched.

A passive joint (ball joint or universal joint) lets a leg turn within a cone about an axis that is fixed to
what carries the joint: at one end the slider, which does not turn, or the crank, at the other the platform.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.kinematics.legs import Legs, angles_between
from hexacell.kinematics.rotations import Array, Mask

ROUNDING = 1e-9
"""Rounding of an angle, rad, or a length, mm: a pose at a limit is within it."""


@dataclass(frozen=True, slots=True, eq=False)
class LegLimits:
    """What passive joints and legs allow.

    Attributes:
        base_axes: (J, 3) unit vectors about which the base's passive joints turn: in the base frame, or
            in that of the crank which carries the joint.
        platform_axes: (J, 3) those of the platform's joints, in the platform frame.
        base_cones: (J,) largest angles of the legs from these axes, rad.
        platform_cones: (J,) those at the platform, rad.
        distance_mm: smallest distance of two legs; 0 is no limit, and has no margin. Below it, where limits
            were widened, everything is allowed, with a margin.
    """

    base_axes: Array
    platform_axes: Array
    base_cones: Array
    platform_cones: Array
    distance_mm: float

    def margins(self, legs: Legs) -> Array:
        """By how much n poses keep these limits, (n, m), negative beyond them.

        The angles, rad, that each leg's passive joints have left, at the base and at the platform, then the
        legs' spare distance, mm, if it has a limit.
        """
        along = legs.directions
        at_base = self.base_cones - angles_between(legs.in_carriers(along), self.base_axes)
        at_platform = self.platform_cones - angles_between(along @ legs.rotations, self.platform_axes)
        distances = [legs.smallest_distance() - self.distance_mm] if self.distance_mm else []
        return np.column_stack([at_base, at_platform, *distances])

    def keeps(self, legs: Legs, wanted: Array | float = 0.0) -> Mask:
        """At which of n poses all :meth:`margins` are at least those wanted (m,).

        Distances take most of the time, and the platform's joints limit most, so that each is computed only
        where those before it are kept.
        """
        count = len(self.base_cones)
        least = np.zeros(2 * count + (self.distance_mm != 0.0)) + wanted
        directions = legs.directions
        at_platform = angles_between(directions @ legs.rotations, self.platform_axes)
        kept = np.asarray((self.platform_cones - at_platform >= least[count : 2 * count]).all(axis=-1))
        legs = legs[kept]
        at_base = angles_between(legs.in_carriers(directions[kept]), self.base_axes)
        are_free = np.asarray((self.base_cones - at_base >= least[:count]).all(axis=-1))
        if self.distance_mm != 0.0:
            are_free[are_free] = legs[are_free].smallest_distance() - self.distance_mm >= least[-1]
        kept[kept] = are_free
        return kept

    def margins_for(self, turn: float, radius_mm: float) -> Array:
        """Margins (m,) that hold should a platform of some radius turn by an angle, rad."""
        turns = np.full(2 * len(self.base_cones), turn)
        return turns if self.distance_mm == 0.0 else np.append(turns, turn * radius_mm)

    def including(self, margins: Array, wanted: Array | float = 0.0) -> "LegLimits":
        """These limits, widened where the :meth:`margins` (m,) at a pose are less than wanted (m,)."""
        missing = np.maximum(0.0, wanted - margins + ROUNDING)
        if not missing.any():
            return self
        count = len(self.base_cones)
        distance = self.distance_mm - float(missing[2 * count :].sum())
        return replace(
            self,
            base_cones=self.base_cones + missing[:count],
            platform_cones=self.platform_cones + missing[count : 2 * count],
            distance_mm=distance if distance or not self.distance_mm else -ROUNDING,
        )
