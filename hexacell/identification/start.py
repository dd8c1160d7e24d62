"""Where the forward kinematics of each record begins: at the commanded pose.

A pose belongs to the geometry that commanded it. That is the controller's, unless the records are
older than its last calibration; then it was, as a rule, the drawing's. Each record is believed to
come from the geometry whose inverse kinematics is nearest to its encoders, and is followed from
there to the drawing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hexacell import kinematics
from hexacell.errors import IdentifiabilityError
from hexacell.geometry import Geometry
from hexacell.mechanisms.base import Branch, Mechanism
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask


def start_poses(
    mechanism: Mechanism,
    drawing: Geometry,
    joints: Array,
    *,
    commanded: Poses,
    under: Sequence[Geometry],
    branch: Branch,
    labels: NDArray[np.int_],
) -> Poses:
    """Poses that close the drawing at the measured joint variables (n, 6), mm.

    Args:
        mechanism: of all geometries.
        drawing: the geometry to end at.
        joints: as the encoders gave them.
        commanded: as the controller was told.
        under: geometries that may have commanded them.
        branch: of the inverse kinematics.
        labels: point and orientation (n, 2), for messages.

    Raises:
        IdentifiabilityError: a record cannot be followed; the message names it.
    """
    computed = np.stack([mechanism.inverse(geometry, branch, commanded) for geometry in under])
    distance = np.abs(np.nan_to_num(computed - joints, nan=np.inf)).max(axis=-1)
    nearest = np.argmin(distance, axis=0)
    positions, rotations = np.array(commanded.positions), np.array(commanded.rotations)
    found = np.zeros(len(joints), dtype=bool)
    for choice, geometry in enumerate(under):
        rows = np.flatnonzero((nearest == choice) & np.isfinite(distance[choice]))
        result = kinematics.follow(
            mechanism,
            drawing,
            joints[rows],
            start=commanded[rows],
            start_geometry=geometry,
            start_joints=computed[choice, rows],
        )
        positions[rows], rotations[rows] = result.poses.positions, result.poses.rotations
        found[rows] = result.found
    _refuse_lost_records(found, labels)
    return Poses(positions, rotations)


def _refuse_lost_records(found: Mask, labels: NDArray[np.int_]) -> None:
    if found.all():
        return
    point, orientation = labels[np.flatnonzero(~found)[0]]
    raise IdentifiabilityError(
        f"{int((~found).sum())} records cannot be followed from the commanded pose to the joint variables "
        f"without crossing a singularity; the first is point {point}, orientation {orientation}",
        action="Leave them out, or check that q1 to q6 belong to the commanded poses",
    )
