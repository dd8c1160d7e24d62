"""Records with other readings than those that were measured."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from hexacell.measurements.records import MeasurementSet, Record


def altered(
    measurements: MeasurementSet,
    change: Callable[[Record], dict[str, Any]],
    where: Callable[[Record], bool] = lambda record: True,
) -> MeasurementSet:
    """The records with the fields that ``change(record)`` gives, of all or of some of them."""

    def one(record: Record) -> Record:
        values = {name: np.asarray(value).tolist() for name, value in change(record).items()}
        given: dict[str, Any] = {
            name: tuple(one) if isinstance(one, list) else one for name, one in values.items()
        }
        return replace(record, **given)

    return MeasurementSet(
        tuple(one(record) if where(record) else record for record in measurements.records)
    )


def later(measurements: MeasurementSet, points: int = 5) -> MeasurementSet:
    """The records at points that are numbered after some others."""
    return altered(measurements, lambda record: {"point": record.point + points})
