"""Whether a few records contradict an unchanged robot, each cause taken alone.

A robot that was identified is known with a covariance C. If it has not changed, whitened residuals r of
new records have the covariance ``S = 1 + H C H^T``. A change of one parameter of the machine by b adds
``-H d b`` to them, with the derivatives d of the free parameters by that one. Against the hypothesis of no
change the most powerful test of this one cause is the score

    z = -d^T H^T S^-1 r / sqrt(d^T H^T S^-1 H d),

which is standard normal without a change (Cox and Hinkley, Theoretical Statistics, 1974, section 9.3). The
largest of all ``|z|`` is compared with what it exceeds by chance with a given probability. The scores are
correlated, in a way that is known; the limit is found by drawing them.

A leg is named, not a parameter: some parameters of one leg do nearly the same to a few records.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.drift.largest_score import largest_by_chance
from hexacell.drift.run_evidence import WhitenedRecords
from hexacell.kinematics.rotations import Array

SEEN_SHARE = 1e-9
"""Of the largest information on a parameter: one with less is not seen at all."""


@dataclass(frozen=True, slots=True, eq=False)
class SingleCauseTest:
    """The scores of m causes.

    Attributes:
        scores: (m,) standard normal without a change; 0 of a cause that the records do not see.
        changes: (m,) the estimate of each change, in the unit of its parameter.
        sigmas: (m,) one standard deviation of it.
        limit: what the largest score exceeds by chance with probability ``FALSE_ALARMS``.
    """

    scores: Array
    changes: Array
    sigmas: Array
    limit: float

    @property
    def likeliest(self) -> int:
        """The cause with the largest score."""
        return int(np.abs(self.scores).argmax())

    @property
    def is_alarm(self) -> bool:
        """Whether an unchanged robot is contradicted."""
        return bool(np.abs(self.scores).max() > self.limit)


def single_cause_test(records: WhitenedRecords, covariance: Array, causes: Array) -> SingleCauseTest:
    """Test each of m causes.

    Args:
        records: linearized at the estimate of before.
        covariance: (s, s) of the state then; of shared causes 1 where nothing is known of them.
        causes: (m, s) change of the state by one unit of each cause.
    """
    rows, residuals = records.rows, records.residuals
    factor = np.linalg.cholesky(np.eye(len(rows)) + rows @ covariance @ rows.T)
    signatures = np.linalg.solve(factor, rows @ causes.T)
    found = -(signatures.T @ np.linalg.solve(factor, residuals))
    information = np.einsum("rm,rm->m", signatures, signatures)
    is_seen = information > SEEN_SHARE * information.max()
    root = np.sqrt(np.where(is_seen, information, 1.0))
    unit = np.where(is_seen, signatures / root, 0.0)
    return SingleCauseTest(
        scores=np.where(is_seen, found / root, 0.0),
        changes=np.where(is_seen, found / root**2, 0.0),
        sigmas=np.where(is_seen, 1.0 / root, np.inf),
        limit=largest_by_chance(unit),
    )
