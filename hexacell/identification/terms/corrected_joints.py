"""What a controller commands that corrects what legs do under a weight."""

import numpy as np

from hexacell.identification.placement import Placement, Weight, leg_forces
from hexacell.identification.terms.compliance import compliance
from hexacell.identification.terms.play import HARDLY_LOADED, play
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

NOT_KNOWN = 0.2
"""Share of what a controller adds to its joints that may differ: it computes forces in its own way."""


def commanded_joints(
    mechanism: Mechanism, geometry: Geometry, branch: Branch, corrections: Corrections, poses: PoseBatch
) -> tuple[Array, Array]:
    """What a controller commands its joints to (n, 6) for some poses, and what of it may differ.

    NaN for poses that are out of reach.
    """
    joints = mechanism.inverse(geometry, branch, poses)
    if corrections.are_none:
        return joints, np.zeros_like(joints)
    at = Placement(mechanism, geometry, poses, np.nan_to_num(joints))
    added, unseated = _added(at, corrections)
    return joints + added, NOT_KNOWN * np.abs(added) + unseated


def _added(at: Placement, corrections: Corrections) -> tuple[Array, Array]:
    """What play and compliance add to the joint variables (n, 6), in their unit, to first order.

    Half a backlash is added beside the joint variables, which do not show it. Beside that comes the whole
    play of legs that hardly anything pulls or pushes: a controller whose joints must not jump may have them
    anywhere between.
    """
    centre = corrections.weight_centre_mm
    weight = Weight(np.array(corrections.weight_direction), None if centre is None else np.array(centre))
    unknown, legs = np.zeros_like(at.joints), at.joints.shape[1]
    play_mm, compliance_um_n = corrections.play_mm[:legs], corrections.compliance_um_n[:legs]
    errors = play(1.0, weight).leg_errors(at, unknown) * play_mm
    yielding = compliance(1.0, corrections.weight_n, weight).leg_errors(at, unknown)
    is_between = np.abs(leg_forces(at, weight)) < HARDLY_LOADED
    unseated = np.abs(at.as_joints(is_between * np.array(play_mm)))
    return -at.as_joints(errors + yielding * compliance_um_n), unseated
