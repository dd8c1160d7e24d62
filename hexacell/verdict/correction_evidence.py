"""Whether a controller adds to its joints what its config says that it corrects.

One that reports success and adds nothing contradicts no model: the encoders show where the joints were
sent, and from there the terms of the model explain where the ball is. But the encoders show as well that
the joints were not sent further than the inverse kinematics demands.
"""

import numpy as np

from hexacell.identification.terms.corrected_joints import commanded_joints
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot
from hexacell.verdict.model_evidence import ModelTest

LEAST_SHARE = 0.5
"""Smallest share of what the config says that counts as corrected."""

SHARP = 0.1
"""Standard deviation of that share from which on records tell."""


def correction_test(robot: Robot, records: MeasurementSet) -> ModelTest | None:
    """The test of the corrections of a robot that commands now, by records taken under them.

    A joint that stands beside its command at all poses alike is no evidence. None where nothing is
    corrected, or the records do not tell.
    """
    corrections, states = robot.corrections, (robot.controller, robot.branch)
    if corrections.are_none or not len(records):
        return None
    bare = robot.mechanism.inverse(*states, records.poses)
    legs, _ = commanded_joints(robot.mechanism, *states, corrections, records.poses)
    lost = np.array(corrections.backlash[: records.joints.shape[1]])
    wanted = legs - bare + 0.5 * lost * records.directions
    rows = ((records.directions != 0.0) | (lost == 0.0)) & np.isfinite(wanted)
    both = np.where(rows, np.stack([wanted, records.joints - bare]), 0.0)
    means = both.sum(axis=1, keepdims=True) / np.maximum(rows.sum(axis=0), 1)
    added, shown = np.where(rows, both - means, 0.0).reshape(2, -1)
    square = float(added @ added)
    if square == 0.0:
        return None
    share = float(added @ shown) / square
    scatter = float(np.sqrt(np.sum((shown - share * added) ** 2) / rows.sum()))
    if max(scatter, robot.noise.encoder) > SHARP * np.sqrt(square):
        return None
    passed = share >= LEAST_SHARE
    sentence = "The controller adds to its joints what its config says."
    if not passed:
        sentence = (
            f"The controller adds {100.0 * max(share, 0.0):.0f} % of the corrections in its config, by the "
            "encoders; see that it reads them, and run again."
        )
    return ModelTest(name="corrections", passed=passed, sentence=sentence)
