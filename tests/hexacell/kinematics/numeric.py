"""Poses for tests of kinematics, and the pose Jacobian by finite differences."""

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.kinematics.pose import Pose, PoseBatch

DEGREES = st.floats(-25.0, 25.0)
POSES = st.builds(
    Pose, st.floats(-100, 100), st.floats(-200, 100), st.floats(450, 600), DEGREES, DEGREES, DEGREES
)
MARGIN = 0.05


def turned_about(axis: str, degrees: float) -> Pose:
    return Pose(0.0, 0.0, 550.0, **{axis: degrees})


def numeric_jacobian(hexaglide, geometry, pose, joints):
    """Central differences of the constraints by position and by rotation vector from the left."""
    columns = []
    for step in 1e-5 * np.eye(6):
        ends = []
        for side in (1.0, -1.0):
            turn = Rotation.from_rotvec(side * step[3:]).as_matrix()
            moved = PoseBatch(pose.positions + side * step[:3], turn @ pose.rotations)
            ends.append(hexaglide.residual_and_jacobian(geometry, moved, joints)[0][0])
        columns.append((ends[0] - ends[1]) / 2e-5)
    return np.array(columns).T
