"""Records as columns: what a measurement file has under the same names, as arrays in memory."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexacell.errors import UsageError
from hexacell.measurements import csv_file
from hexacell.measurements.records import MeasurementSet


def columns_of(measurements: MeasurementSet) -> dict[str, NDArray[Any]]:
    """The columns (n,) of some records, by the names and in the units of a measurement file.

    ``x y z`` mm, ``a b c`` deg, ``q1`` to ``q6`` mm or deg, ``dx dy dz`` mm, ``point`` and ``orientation``
    from 1; ``d1`` to ``d6``, ``t1`` to ``t6``, ``tb`` and ``time_s`` where a record has any.
    """
    count = len(measurements)
    poses = np.array([one.pose.as_tuple() for one in measurements.records], dtype=float).reshape(count, 6)
    joints = measurements.joints
    numbers = np.hstack([poses, joints, measurements.deviations])
    found: dict[str, NDArray[Any]] = dict(zip(csv_file.COUNTS, measurements.labels.T, strict=True))
    found |= zip(csv_file.numbers_of(joints.shape[1]), numbers.T, strict=True)
    if measurements.directions.any():
        found |= zip(csv_file.directions_of(joints.shape[1]), measurements.directions.T, strict=True)
    if np.isfinite(measurements.temperatures).any():
        found |= zip(csv_file.TEMPERATURES, measurements.temperatures.T, strict=True)
    if np.isfinite(measurements.times_s).any():
        found[csv_file.TIME] = measurements.times_s
    return found


def measurements_of(columns: Mapping[str, ArrayLike]) -> MeasurementSet:
    """The records in such columns, or in a ``pandas.DataFrame`` of them.

    Raises:
        UsageError: they are not equally long.
        FileError: as ``read_measurements`` does; its line counts the records from 2.
    """
    lists = {str(name): np.ravel(np.asarray(columns[name])).tolist() for name in columns}
    if len({len(one) for one in lists.values()}) > 1:
        lengths = ", ".join(f"{name} {len(one)}" for name, one in lists.items())
        raise UsageError(f"the columns are not equally long: {lengths}", action="Give one value a record")
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(lists)
    for values in zip(*lists.values(), strict=True):
        rows.writerow(_cell(name, value) for name, value in zip(lists, values, strict=True))
    return csv_file.measurements_in(Path("the columns"), text.getvalue())


def _cell(name: str, value: object) -> object:
    """A value as a file has it: 3 where an array has 3.0, and nothing where an optional one is NaN."""
    if name in csv_file.numbers_of(csv_file.MOST_JOINTS) or not isinstance(value, float):
        return value
    return "" if np.isnan(value) else f"{value:.17g}"
