"""Records as arrays, and invalid sets of them."""

import numpy as np
import pytest

from hexacell.errors import UsageError
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record


def record(point: int, orientation: int, z: float = 550.0) -> Record:
    return Record(point, orientation, Pose(1, 2, z, 10, 20, 30), (1, 2, 3, 4, 5, 6), (0.1, 0.2, 0.3))


def test_records_as_arrays():
    a, b = record(1, 1), record(1, 2, z=500.0)
    measurements = MeasurementSet((a, b))
    assert len(measurements) == 2
    np.testing.assert_array_equal(measurements.labels, [[1, 1], [1, 2]])
    np.testing.assert_array_equal(measurements.points, [1, 1])
    np.testing.assert_array_equal(measurements.poses.positions, [[1, 2, 550], [1, 2, 500]])
    np.testing.assert_array_equal(measurements.poses.rotations[1], b.pose.rotation)
    np.testing.assert_array_equal(measurements.joints, [[1, 2, 3, 4, 5, 6]] * 2)
    np.testing.assert_array_equal(measurements.deviations, [[0.1, 0.2, 0.3]] * 2)
    assert measurements.joints.dtype == float


def test_points_are_grouped_in_the_order_of_measurement():
    order = [(7, 1), (3, 5), (7, 2), (3, 1), (9, 1)]
    measurements = MeasurementSet(tuple(record(*label) for label in order))
    np.testing.assert_array_equal(measurements.group, [0, 1, 0, 1, 2])


def test_the_same_record_twice_is_refused():
    with pytest.raises(UsageError, match="two records of point 2, orientation 3"):
        MeasurementSet((record(2, 3), record(2, 4), record(2, 3, z=0.0)))
