"""Whole poses measured, as FIGAROH and robot_calibration have it: encoders by inverse kinematics.

It needs an instrument that three gauges are not: position and orientation in one frame, of every record.
Then each leg's seven numbers are a least-squares problem of its own, and the frames are the instrument's.
"""

import numpy as np
from scipy.optimize import least_squares

from hexacell.kinematics.rotations import Array
from tests.benchmarks.peers.robots import Records


def solve(records: Records) -> Array:
    """See the module."""
    S, B, lengths = np.split(records.drawing, (18, 36))
    legs = np.column_stack([S.reshape(6, 3), B.reshape(6, 3), lengths])
    found = np.array([_leg(records, leg, start) for leg, start in enumerate(legs)])
    return np.concatenate([found[:, :3].ravel(), found[:, 3:6].ravel(), found[:, 6]])


def _leg(records: Records, leg: int, start: Array) -> Array:
    def errors(numbers: Array) -> Array:
        legs = numbers[:3] - records.full_positions - records.full_rotations @ numbers[3:6]
        square = numbers[6] ** 2 - legs[:, 1] ** 2 - legs[:, 2] ** 2
        along = records.branch[leg] * np.sqrt(np.maximum(square, 0.0)) - legs[:, 0]
        result: Array = along - records.joints[:, leg]
        return result

    found = least_squares(errors, start, method="trf", x_scale="jac")
    if not found.success:
        raise ArithmeticError(found.message)
    numbers: Array = found.x
    return numbers
