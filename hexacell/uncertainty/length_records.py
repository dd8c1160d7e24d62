"""Records of a length check: the same ball in two parallel seats of a fixture, a known distance apart.

The gauges are zeroed once, in the first seat, and mounted in the two seats in turn. Where the gauges of a
mounting would show zero, the ball's centre is in the place of that seat; the places of the two seats are
the certified distance apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import IdentifiabilityError
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import Placement, Readings


@dataclass(frozen=True, slots=True)
class LengthStandard:
    """A fixture with two seats for the gauges; uncertainties are one standard deviation.

    Attributes:
        distance_mm: of the two places of the ball, at the temperature of the check.
        certificate_mm: of that distance.
        temperature_um_m: of the distance, by the temperature of the fixture.
        parallel: angle between the seats, about each axis, rad.
        height_mm: of the ball above the line along which the distance is certified.
        seating_mm: of the gauges' place, along each axis, at every mounting.
    """

    distance_mm: float
    certificate_mm: float
    temperature_um_m: float = 0.0
    parallel: float = 0.0
    height_mm: float = 0.0
    seating_mm: float = 0.0


@dataclass(frozen=True, eq=False)
class LengthRecords:
    """n records in the mechanism's frame convention.

    Attributes:
        mountings: (n,) number of the mounting, from 1; the first seat has the odd ones.
        placement: the robot at the records, by the geometry that is judged and the joint variables shown.
        deviations: (n, 3), mm, of the ball from the gauges' zero, along the base axes.
        gauges: (3, 3), columns: measuring directions of the gauges.
    """

    mountings: NDArray[np.int_]
    placement: Placement
    deviations: Array
    gauges: Array

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        geometry: Geometry,
        commands: PoseBatch,
        joints: Array,
        deviations: Array,
        mountings: NDArray[np.int_],
        gauges: Array,
    ) -> LengthRecords:
        """Records commanded under (nearly) the geometry that is judged, joint variables (n, 6), mm.

        Raises:
            IdentifiabilityError: the geometry has no pose near a command at its joint variables.
        """
        solved = forward_kinematics(mechanism, geometry, joints, commands)
        if not solved.found.all():
            raise IdentifiabilityError(
                "in the length check the joint variables do not belong to the commanded poses",
                action="Check that the controller commands with the geometry in its config",
            )
        placement = Placement(mechanism, geometry, solved.poses, joints)
        return cls(mountings, placement, deviations, gauges)

    def __len__(self) -> int:
        return len(self.mountings)

    @property
    def seats(self) -> NDArray[np.int_]:
        """(n,) 0 for the first seat and 1 for the second."""
        return (self.mountings + 1) % 2

    @property
    def places(self) -> Array:
        """(n, 3) where the ball would be with the gauges at zero, by the robot, mm."""
        difference: Array = self.placement.poses.positions - self.deviations
        return difference

    @property
    def readings(self) -> Readings:
        """What the gauges saw."""
        return Readings(self.placement.poses.rotations, self.deviations, self.gauges)
