"""Whether joint variables belong to the commanded poses.

A controller goes where its geometry sends it: q is the inverse kinematics of the commanded pose
under the geometry that the controller had then. Which one that was need not be known, an earlier
calibration may have written it; but it lay within the drawing's tolerances, and they change q by no
more than the sum of what each parameter of a leg changes it by at either end of its tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from hexacell.errors import IdentifiabilityError
from hexacell.geometry import LEGS, Geometry, from_per_leg, per_leg
from hexacell.identification.start import Commands
from hexacell.mechanisms.base import Branch
from hexacell.rotations import Array

UNSUSPICIOUS_MM = 1.0
"""Machines go where they are sent more exactly than that: nearer q need no closer look."""


@dataclass(frozen=True, slots=True, eq=False)
class JointData:
    """Joint variables beside what was commanded.

    Attributes:
        measured: (n, 6), mm.
        labels: (n, 2) point and orientation.
        drawing: within ``widths`` (7,), mm, of which every geometry of the controller lay: the
            tolerances of a leg's S, B and l.
    """

    commands: Commands
    measured: Array
    labels: NDArray[np.int_]
    branch: Branch
    drawing: Geometry
    widths: Array

    def refuse_foreign(self) -> None:
        """Raise where a leg stands where no geometry within the tolerances sends it.

        Raises:
            IdentifiabilityError: names the first record and its worst leg; the columns that look
                exchanged, if some do.
        """
        difference = np.abs(self.measured - self.commands.joints)
        suspicious = np.flatnonzero(np.nanmax(difference, axis=-1, initial=0.0) > UNSUSPICIOUS_MM)
        excess = difference[suspicious] - self._explicable(suspicious)
        foreign = np.nanmax(excess, axis=-1, initial=0.0) > 0.0
        if not foreign.any():
            return
        first = suspicious[foreign][0]
        leg = int(np.nanargmax(excess[foreign][0]))
        raise IdentifiabilityError(
            f"in {np.count_nonzero(foreign)} of {len(self.measured)} records the joint variables do not belong "
            f"to the commanded pose; the first is point {self.labels[first, 0]}, orientation "
            f"{self.labels[first, 1]}, where q{leg + 1} is {difference[first, leg]:.1f} mm off, and the "
            f"tolerances explain {difference[first, leg] - excess[foreign][0, leg]:.1f} mm",
            action=self._advice(),
        )

    def _explicable(self, rows: NDArray[np.intp]) -> Array:
        """How far (k, 6), mm, tolerances can take each joint variable; infinite at the end of reach."""
        at_drawing = self._commanded(rows, np.zeros(7))
        changes = np.zeros((len(rows), LEGS))
        for parameter in np.diag(self.widths):
            ends = [np.abs(self._commanded(rows, sign * parameter) - at_drawing) for sign in (-1.0, 1.0)]
            changes += np.maximum(*ends)
        return np.nan_to_num(changes, nan=np.inf)

    def _commanded(self, rows: NDArray[np.intp], change: Array) -> Array:
        """Joint variables (k, 6), mm, with every leg changed by (7,), mm."""
        legs = per_leg(self.drawing.vector()) + change
        geometry = Geometry.from_vector(from_per_leg(legs))
        return self.commands.mechanism.inverse(geometry, self.branch, self.commands.poses[rows])

    def _advice(self) -> str:
        columns = self._columns()
        moved = [leg for leg in range(LEGS) if columns[leg] != leg]
        if not moved:
            return "Check that q1 to q6 and the pose stand in the same row, and which config commanded it"
        names = ", ".join(f"q{leg + 1}" for leg in moved)
        right = ", ".join(f"q{columns[leg] + 1}" for leg in moved)
        return f"The columns {names} look as if they were {right}: check which encoder is on which slider"

    def _columns(self) -> list[int]:
        """Which column (6,) agrees best with each leg's commands."""
        distance = np.abs(self.measured[:, None, :] - self.commands.joints[:, :, None])
        _, columns = linear_sum_assignment(np.nan_to_num(np.nanmedian(distance, axis=0), nan=1e9))
        return [int(column) for column in columns]
