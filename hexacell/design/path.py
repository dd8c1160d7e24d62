"""The way between two commanded poses, checked before it is taken."""

from __future__ import annotations

import numpy as np

from hexacell import kinematics, rotations
from hexacell.design.knowledge import Knowledge
from hexacell.geometry import Geometry
from hexacell.pose import Poses
from hexacell.rotations import Array

PIECES = 12


def straight(start: Poses, end: Poses, pieces: int = PIECES) -> Poses:
    """The poses (pieces + 1) on a controller's straight line from one pose to another.

    Controllers move all six numbers x, y, z, a, b, c evenly (LinuxCNC's G0), angles included.
    """
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None]
    angles = [rotations.to_angles(poses.rotations[0]) for poses in (start, end)]
    return Poses(
        (1.0 - share) * start.positions[0] + share * end.positions[0],
        rotations.from_angles((1.0 - share) * angles[0] + share * angles[1]),
    )


def is_clear(knowledge: Knowledge, start: Poses, end: Poses, reference: Array | None = None) -> bool:
    """Whether the straight line between two commands keeps to the limits.

    Joint ranges and the singularity margin hold all along, by the controller's geometry and by the
    estimated one. With the gauges at a ``reference`` (3,), mm, the ball stays inside their travel.
    """
    way = straight(start, end)
    joints = knowledge.mechanism.inverse(knowledge.controller, knowledge.branch, way)
    limits = knowledge.limits
    if not ((joints >= limits.joint_min_mm) & (joints <= limits.joint_max_mm)).all():
        return False
    really = kinematics.follow(
        knowledge.mechanism,
        knowledge.estimate,
        joints,
        start=way,
        start_geometry=knowledge.controller,
        start_joints=joints,
    )
    if not really.found.all():
        return False
    for geometry, poses in ((knowledge.controller, way), (knowledge.estimate, really.poses)):
        if not _stays_clear_of_singularities(knowledge, geometry, poses, joints):
            return False
    if reference is None:
        return True
    return bool(np.abs(really.poses.positions - reference).max() <= limits.gauge_travel_mm)


def _stays_clear_of_singularities(
    knowledge: Knowledge, geometry: Geometry, way: Poses, joints: Array
) -> bool:
    margin = kinematics.singularity_margin(knowledge.mechanism, geometry, way, joints)
    # Between two of the poses looked at a singularity may lie unseen; beyond it the mode is another.
    mode = kinematics.assembly_mode(kinematics.pose_jacobian(knowledge.mechanism, geometry, way, joints))
    # The ends were chosen under the limit itself; on the way half of it will do.
    far_enough = margin.min() >= 0.5 * knowledge.limits.singularity_margin
    return bool(far_enough and (mode == mode[0]).all())
