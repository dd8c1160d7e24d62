"""Encoder consistency: do the joint variables belong to the commanded poses?

The joint variables q are the inverse kinematics of the commanded pose under the geometry that the
controller had at that time. That geometry may be unknown, but it was within the drawing's tolerances.
Its effect on q is bounded by worst-case tolerance analysis: the sum, over the parameters of a leg, of
the larger change of q at the two ends of the tolerance.
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

ACCEPTED_MM = 1.0
"""Differences up to this are normal on any machine."""

MAX_OUTLIER_SHARE = 0.2
"""Largest share of the records that may be inconsistent."""


@dataclass(frozen=True, slots=True, eq=False)
class EncoderConsistency:
    """The measured joint variables and the commanded poses of n records.

    The controller's geometries are within ``widths`` (c,) of the drawing: the tolerances of the numbers of
    one leg, in the order of the kinds. ``measured`` is (n, 6), mm; ``labels`` are point and orientation.
    """

    commands: CommandedPoses
    measured: Array
    labels: NDArray[np.int_]
    branch: Branch
    drawing: Geometry
    widths: Array

    def check(self) -> None:
        """Require that a geometry within the tolerances explains the joint variables.

        A few inconsistent records are accepted here: the search for false readings names them.

        Raises:
            IdentifiabilityError: names the first record and its worst leg, and the columns that look
                exchanged, if any.
        """
        # NaN is a pose out of reach; build_problem reports those.
        difference = np.nan_to_num(np.abs(self.measured - self.commands.joints), nan=0.0)
        if _is_small_share(_in_any_leg(difference > ACCEPTED_MM)):
            return
        explained = self._explained()
        inconsistent = _in_any_leg(difference > explained)
        if _is_small_share(inconsistent):
            return
        first = int(np.argmax(inconsistent))
        leg = int(np.argmax(difference[first] - explained[first]))
        point, orientation = self.labels[first]
        raise IdentifiabilityError(
            f"in {np.count_nonzero(inconsistent)} of {len(self.labels)} records the joint variables do not "
            f"belong to the commanded pose; the first is point {point}, orientation {orientation}, where "
            f"q{leg + 1} is {difference[first, leg]:.1f} mm off, and the tolerances explain "
            f"{explained[first, leg]:.1f} mm",
            action=self._advice(explained),
        )

    def _explained(self) -> Array:
        """Bound (n, 6), mm, of the tolerances' effect on each joint variable; infinite if out of reach."""
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

    def _advice(self, explained: Array) -> str:
        columns = self._columns()
        difference = np.nan_to_num(np.abs(self.measured[:, columns] - self.commands.joints), nan=0.0)
        if not _is_small_share(_in_any_leg(difference > explained)):
            return "Check that q1 to q6 are in the row of their pose, in mm, and which config commanded it"
        moved = [leg for leg in range(LEGS) if columns[leg] != leg]
        names, sources = (
            ", ".join(f"q{leg + 1}" for leg in legs) for legs in (moved, [columns[leg] for leg in moved])
        )
        joint = self.commands.mechanism.words.joint
        return f"The columns {names} look like those of {sources}: check which encoder is on which {joint}"

    def _columns(self) -> list[int]:
        """The column (6,) that fits each leg's commands best: a linear assignment."""
        # The import takes a sixth of the start-up time, and only wrong columns need it.
        from scipy.optimize import linear_sum_assignment  # noqa: PLC0415

        reached = np.isfinite(self.commands.joints).all(axis=-1)
        measured, commanded = self.measured[reached], self.commands.joints[reached]
        distance = np.median(np.abs(measured[:, None, :] - commanded[:, :, None]), axis=0)
        _, columns = linear_sum_assignment(distance)
        return [int(column) for column in columns]


def _in_any_leg(joints: Mask) -> Mask:
    records: Mask = np.logical_or.reduce(joints, axis=-1)
    return records


def _is_small_share(records: Mask) -> bool:
    return bool(np.count_nonzero(records) <= MAX_OUTLIER_SHARE * len(records))
