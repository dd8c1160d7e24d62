"""Reversal and repeatability (ISO 230-2): how a robot comes back to a pose from one side and the other.

A joint with the reversal value b stops b/2 below its place where it came from below, and b/2 above it where
it came from above. Between two visits of a pose whose directions of arrival differ by t, each -2, 0 or 2,
the gauges change by ``-G diag(t) b / 2``, which no encoder shows, with G = dP/dq. From all such changes b
follows by weighted least squares, beside what is known of it before: not every joint turns at every visit.
The noise is as large as what is left of the changes shows.

Of the ball the reversal is that of all joints together, ``G b``. Its bidirectional repeatability along a
gauge is that and four standard deviations of its visits from one side; of these alone if no joint turned.
"""

from collections.abc import Sequence

import numpy as np

from hexacell.cell.fields import Frozen
from hexacell.kinematics.corrections import Six
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import joints_of
from hexacell.noise.allowances import ReferenceChange

FEWEST_CHANGES = 3
"""Fewer changes say nothing."""

SIGMAS = 4.0
"""Standard deviations from end to end of a repeatability by ISO 230-2."""


class Reversal(Frozen):
    """What repeated visits show.

    Attributes:
        visits: beside the first one of each reference.
        repeatability_mm: of the ball along the gauge where it is largest, to and fro or from one side.
        joints: reversal value of each joint; None where no joint ever came from another side.
        sigma: one standard deviation of each, and the ``unit`` of both.
        ball_mm: reversal of the ball along that gauge, and ``ball_sigma_mm``.
    """

    visits: int
    repeatability_mm: float
    joints: Six | None = None
    sigma: Six | None = None
    unit: JointUnit = JointUnit.MM
    ball_mm: float = 0.0
    ball_sigma_mm: float = 0.0


def reversal_of(
    visits: Sequence[tuple[ReferenceChange, Array]], known: Array, sigma: Array, unit: JointUnit
) -> Reversal | None:
    """Reversal and repeatability, those of the ball at the pose of the first visits; None of too few.

    Of each pair of ``visits``: how what is shown differs, and how the directions of arrival (6,) do.
    Beforehand each joint's reversal value (6,) is ``known``, with one standard deviation ``sigma`` (6,).
    """
    if len(visits) < FEWEST_CHANGES:
        return None
    changes, by_joints = [change for change, _ in visits], visits[0][0].by_joints
    columns = np.stack([-0.5 * change.by_joints * turned for change, turned in visits])
    beside_encoders = np.stack([one.unexplained_mm for one in changes])
    seen_by_encoders = np.stack([one.by_joints @ one.joints for one in changes])
    unexplained = beside_encoders - columns @ known
    weights = np.linalg.inv([one.covariance for one in changes])
    information = np.einsum("nij,nik,nkl->jl", columns, weights, columns)
    seen = np.einsum("nij,nik,nk->j", columns, weights, unexplained)
    factor, prior = 1.0, np.diag(sigma**-2.0)
    for _ in range(2):  # the second time with the noise that is left at first
        covariance = np.linalg.inv(information / factor + prior)
        more = covariance @ seen / factor
        left = unexplained - columns @ more
        freedom = left.size - float(np.trace(covariance @ information) / factor)
        factor = max(1.0, float(np.einsum("ni,nij,nj->", left, weights, left) / freedom))
    joints = known + more
    shown = beside_encoders + seen_by_encoders
    # Of one of two visits. A reversal that is not there, but noise of encoders, would make it larger.
    from_one_side = np.minimum((shown**2).sum(axis=0), ((shown - columns @ joints) ** 2).sum(axis=0))
    scatter = np.sqrt(1.5 * from_one_side / freedom)
    has_turned = bool(columns.any())
    ball = np.abs(by_joints @ joints) * has_turned
    variances = np.diag(by_joints @ covariance @ by_joints.T)
    worst = int(np.argmax(ball + SIGMAS * scatter))
    return Reversal(
        visits=len(visits),
        repeatability_mm=float(ball[worst] + SIGMAS * scatter[worst]),
        joints=joints_of(joints) if has_turned else None,
        sigma=joints_of(np.sqrt(np.diag(covariance))) if has_turned else None,
        unit=unit,
        ball_mm=float(ball[worst]),
        ball_sigma_mm=float(np.sqrt(variances[worst])) * has_turned,
    )
