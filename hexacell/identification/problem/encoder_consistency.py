"""Encoder consistency: do the joint variables belong to the commanded poses?

The joint variables q are the inverse kinematics of the commanded pose under the geometry in the
controller at that time. That geometry may be unknown, but it was within the drawing's tolerances.
These change q by at most the sum, over the parameters of a leg, of the change at either end of the
tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.commanded_poses import CommandedPoses
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.parameters import LEGS
from hexacell.kinematics.rotations import Array, Mask

UNSUSPICIOUS_MM = 1.0
"""Smaller differences are those of any working machine."""

FEW = 0.2
"""Of the records."""

FEWEST_TO_COMPARE = 3
STRAY_SCATTERS = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class EncoderConsistency:
    """Joint variables beside what was commanded.

    Attributes:
        measured: (n, 6), mm.
        labels: (n, 2) point and orientation.
        drawing: within ``widths`` (7,), mm, of which every geometry of the controller lay: the
            tolerances of a leg's S, B and l.
    """

    commands: CommandedPoses
    measured: Array
    labels: NDArray[np.int_]
    branch: Branch
    drawing: Geometry
    widths: Array

    def check(self) -> None:
        """Raise where legs stand where no geometry within the tolerances sends them.

        A few such records are left to the tests for gross errors, which name them.

        Raises:
            IdentifiabilityError: names the first record and its worst leg; the columns that look
                exchanged, if some do.
        """
        # Where no leg reaches the pose, the solver finds no start either, and says so.
        difference = np.nan_to_num(np.abs(self.measured - self.commands.joints), nan=0.0)
        if _are_few(_in_any_leg(difference > UNSUSPICIOUS_MM)):
            return
        explicable = self._explicable()
        foreign = _in_any_leg(difference > explicable)
        if _are_few(foreign):
            return
        first = int(np.argmax(foreign))
        leg = int(np.argmax(difference[first] - explicable[first]))
        point, orientation = self.labels[first]
        raise IdentifiabilityError(
            f"in {np.count_nonzero(foreign)} of {self.labels.shape[0]} records the joint variables do not "
            f"belong to the commanded pose; the first is point {point}, orientation {orientation}, where "
            f"q{leg + 1} is {difference[first, leg]:.1f} mm off, and the tolerances explain "
            f"{explicable[first, leg]:.1f} mm",
            action=self._advice(explicable),
        )

    def _explicable(self) -> Array:
        """How far (n, 6), mm, tolerances can take each joint variable; infinite at the end of reach."""
        at_drawing = self._commanded(np.zeros(len(self.widths)))
        changes = np.zeros_like(at_drawing)
        for parameter in np.diag(self.widths):
            ends = [np.abs(self._commanded(sign * parameter) - at_drawing) for sign in (-1.0, 1.0)]
            changes += np.maximum(*ends)
        return np.nan_to_num(changes, nan=np.inf)

    def _commanded(self, change: Array) -> Array:
        """Joint variables (n, 6), mm, with the numbers of every leg changed by (c,)."""
        parameters = self.drawing.parameters
        geometry = Geometry(parameters, self.drawing.vector + parameters.of_every_leg(change))
        return self.commands.mechanism.inverse(geometry, self.branch, self.commands.poses)

    def _advice(self, explicable: Array) -> str:
        columns = self._columns()
        difference = np.nan_to_num(np.abs(self.measured[:, columns] - self.commands.joints), nan=0.0)
        if not _are_few(_in_any_leg(difference > explicable)):
            return (
                "Check that q1 to q6 stand in the row of their pose, in mm, and which config commanded it"
            )
        moved = [leg for leg in range(LEGS) if columns[leg] != leg]
        names, right = (
            ", ".join(f"q{leg + 1}" for leg in legs) for legs in (moved, [columns[leg] for leg in moved])
        )
        return f"The columns {names} look like those of {right}: check which encoder is on which slider"

    def _columns(self) -> list[int]:
        """Which column (6,) agrees best with each leg's commands."""
        # Costs every command a sixth of its start, and only wrong columns need it.
        from scipy.optimize import linear_sum_assignment  # noqa: PLC0415

        reached = np.isfinite(self.commands.joints).all(axis=-1)
        measured, commanded = self.measured[reached], self.commands.joints[reached]
        distance = np.median(np.abs(measured[:, None, :] - commanded[:, :, None]), axis=0)
        _, columns = linear_sum_assignment(distance)
        return [int(column) for column in columns]


def _in_any_leg(joints: Mask) -> Mask:
    records: Mask = np.logical_or.reduce(joints, axis=-1)
    return records


def _are_few(records: Mask) -> bool:
    return bool(np.count_nonzero(records) <= FEW * len(records))


def inconsistent_leg(
    commands: CommandedPoses, measured: Array, row: int, others: Mask
) -> tuple[int, float] | None:
    """The leg (from 1) that in one record stands farthest from where it does in other ones, and mm.

    Compared is how far joint variables (n, 6) are from the commanded ones: that changes little from
    pose to pose of a point, whatever geometry the controller had.
    """
    misfit = measured - commands.joints
    known = misfit[others & np.isfinite(misfit).all(axis=-1)]
    if len(known) < FEWEST_TO_COMPARE or not np.isfinite(misfit[row]).all():
        return None
    usual = np.median(known, axis=0)
    scatter = np.median(np.abs(known - usual), axis=0)
    off = misfit[row] - usual
    beyond = np.abs(off) - UNSUSPICIOUS_MM - STRAY_SCATTERS * scatter
    leg = int(np.argmax(beyond))
    return (leg + 1, float(off[leg])) if beyond[leg] > 0.0 else None
