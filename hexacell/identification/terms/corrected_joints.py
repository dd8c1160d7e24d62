"""What a controller commands that corrects what legs do under a weight."""

import numpy as np

from hexacell.identification.placement import Placement
from hexacell.identification.terms.compliance import compliance
from hexacell.identification.terms.play import play
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


def commanded_joints(
    mechanism: Mechanism, geometry: Geometry, branch: Branch, corrections: Corrections, poses: PoseBatch
) -> tuple[Array, Array]:
    """What a controller commands its joints to (n, 6) for some poses, and how much of it corrects.

    NaN for poses that are out of reach.
    """
    joints = mechanism.inverse(geometry, branch, poses)
    if corrections.are_none:
        return joints, np.zeros_like(joints)
    added = _added(Placement(mechanism, geometry, poses, np.nan_to_num(joints)), corrections)
    return joints + added, added


def _added(at: Placement, corrections: Corrections) -> Array:
    """What play and compliance add to the joint variables (n, 6), in their unit, to first order.

    Half a backlash is added beside the joint variables, which do not show it.
    """
    direction, centre = np.array(corrections.weight_direction), corrections.weight_centre_mm
    acts = direction, None if centre is None else np.array(centre)
    unknown = np.zeros_like(at.joints)
    errors = play(1.0, *acts).leg_errors(at, unknown) * corrections.play_mm
    yielding = compliance(1.0, corrections.weight_n, *acts).leg_errors(at, unknown)
    return -at.as_joints(errors + yielding * corrections.compliance_um_n)
