"""Backlash: a joint lags behind its encoder, by half of the lost motion on either side.

An encoder on the motor counts a way that the joint does not go when it turns round (ISO 230-2, reversal
value). The joint's place is between the two that it has when it comes from below and from above.
"""

import numpy as np

from hexacell.identification.placement import Placement
from hexacell.identification.terms.term import ModelTerm, StatedMachine
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.rotations import Array


def backlash(size: float, unit: JointUnit = JointUnit.MM) -> ModelTerm:
    """The backlash of each joint; ``size`` is in the unit of the joints."""
    return ModelTerm(
        "backlash",
        str(unit),
        size,
        _lagging,
        needs_directions=True,
        shown_by="the same poses reached from both sides",
        on_either_side=_where_unknown,
    )


def stated_backlash(machine: StatedMachine) -> ModelTerm:
    """The backlash that a cell file states."""
    return backlash(machine.sizes["backlash"], machine.joint_unit)


def _lagging(placement: Placement, directions: Array) -> Array:
    return np.asarray(-0.5 * placement.derivatives.joints * directions)


def _where_unknown(placement: Placement, directions: Array, sizes: Array) -> Array:
    lagging = np.where(directions == 0.0, 0.5 * placement.derivatives.joints * sizes, 0.0)
    return np.asarray(lagging[..., None] * placement.each_leg)
