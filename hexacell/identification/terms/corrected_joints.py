"""What a controller commands that corrects what legs do under a weight."""

import numpy as np

from hexacell.identification.placement import Placement
from hexacell.identification.terms.compliance import compliance
from hexacell.identification.terms.play import play
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.rotations import Array


def added_to_joints(at: Placement, corrections: Corrections) -> Array:
    """What is added to the joint variables (n, 6) of some poses, in their unit, to first order.

    By play and compliance; half a backlash is added beside the joint variables, which do not show it.
    """
    direction, centre = np.array(corrections.weight_direction), corrections.weight_centre_mm
    acts = direction, None if centre is None else np.array(centre)
    unknown = np.zeros_like(at.joints)
    errors = play(1.0, *acts).leg_errors(at, unknown) * corrections.play_mm
    yielding = compliance(1.0, corrections.weight_n, *acts).leg_errors(at, unknown)
    return -at.as_joints(errors + yielding * corrections.compliance_um_n)
