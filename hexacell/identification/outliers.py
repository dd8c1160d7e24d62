"""Records that do not agree with the others.

The statistic of a record is its squared residual in the metric of that residual's own covariance
(the record's less what its point's constant and the parameters take up): the test of a shift in
that record's mean, chi-square with three degrees of freedom for a good one.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from hexacell.identification.centring import Centring
from hexacell.identification.model import Prediction
from hexacell.identification.problem import Problem
from hexacell.rotations import Array

FALSE_ALARMS_PER_RECORD = 1e-5
LARGEST_SHARE = 0.1
MEDIAN_OF_CHI2_3 = 2.366


def statistics(problem: Problem, prediction: Prediction, covariance: Array) -> Array:
    """The statistic (n,) of each record, the free parameters having covariance (p, p), mm^2."""
    centring = Centring(problem, prediction.weights)
    residuals, jacobian = centring.centred(prediction.residuals), centring.centred(prediction.jacobian)
    own = np.linalg.inv(prediction.weights)
    left = own - centring.absorbed() - jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)
    # A record that alone determines something has no residual there to be judged by.
    values, axes = np.linalg.eigh(left)
    along = np.einsum("nij,ni->nj", axes, residuals)
    judged = values > 1e-3 * np.linalg.eigvalsh(own)[:, :1]
    return np.asarray(np.sum(np.where(judged, along**2 / np.where(judged, values, 1.0), 0.0), axis=-1))


def threshold(values: Array) -> float:
    """The largest statistic a good record may have, scaled up where the stated noise is too small."""
    scale = max(1.0, float(np.median(values)) / MEDIAN_OF_CHI2_3)
    return scale * float(chdtri(3, FALSE_ALARMS_PER_RECORD))
