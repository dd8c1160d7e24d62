"""Errors of records that are no noise, as the tests of a model need them: their covariance.

A machine that is as good as is stated of it still has effects that the kinematic model leaves out. They
make the residuals larger than the noise does, which is no evidence against the model. Some are the same in
all records, which makes these errors correlated; others differ from record to record.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredPoses:
    """What is known of n records under a geometry.

    Attributes:
        geometry: in the mechanism's frame convention.
        poses: of the platform.
        joints: (n, 6), mm.
        deviations: (n, 3), mm, along the base axes.
        gauges: (3, 3), columns: measuring directions of the gauges.
    """

    mechanism: Mechanism
    geometry: Geometry
    poses: PoseBatch
    joints: Array
    deviations: Array
    gauges: Array


@dataclass(frozen=True, slots=True, eq=False)
class SystematicErrors:
    """Errors of n records, mm, beside their noise.

    Attributes:
        common: (n, 3, k) by one standard deviation of each of k independent causes.
        own: (n, 3, 3) covariance, mm^2, of what is another error in each record.
    """

    common: Array
    own: Array

    @property
    def are_none(self) -> bool:
        """Whether the records have noise alone."""
        return not self.common.shape[-1] and not self.own.any()


class SystematicModel(Protocol):
    """The errors that some measured poses have."""

    def __call__(self, measured: MeasuredPoses, /) -> SystematicErrors:
        """The errors of n records."""
        ...


def no_systematic_errors(measured: MeasuredPoses, /) -> SystematicErrors:
    """Of a machine that has none."""
    records = len(measured.joints)
    return SystematicErrors(np.zeros((records, 3, 0)), np.zeros((records, 3, 3)))
