"""The problem of a measurement set; while measuring, from that of the records before.

A record does not change what is known of those before it: how it was commanded, and its start pose. These
are taken over, and computed for the new records alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.commanded_poses import CommandedPoses, CommandingGeometry
from hexacell.identification.problem.encoder_consistency import EncoderConsistency
from hexacell.identification.problem.problem import Noise, Prior, Problem, first_rows_of
from hexacell.identification.problem.systematic_errors import SystematicModel, no_systematic_errors
from hexacell.kinematics.forward import ForwardResult
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import MeasurementSet


def build_problem(
    mechanism: Mechanism,
    measurements: MeasurementSet,
    *,
    controller: CommandingGeometry,
    branch: Branch,
    prior: Prior,
    noise: Noise,
    provisional: Sequence[Geometry] = (),
    earlier: Sequence[CommandingGeometry] = (),
    systematic: SystematicModel = no_systematic_errors,
    unknowns: int = 0,
    before: Problem | None = None,
) -> Problem:
    """The problem of a measurement set.

    The poses were commanded under the ``controller``'s geometry, or in the same frames under
    ``provisional`` ones, in the frame convention, the last one used last. Records from before the last
    calibration may have been commanded under the drawing, or under ``earlier`` geometries in their frames.
    ``before`` is the problem of some of these records, if it is known: what it has of them is taken over.

    Raises:
        IdentifiabilityError: joint variables do not belong to the commanded poses, or for most records
            no continuation from the commanding to the initial geometry exists; the message names the
            first.
    """
    order = np.argsort(measurements.group, kind="stable")
    labels, frames = measurements.labels[order], controller.frames
    here = [controller, *(CommandingGeometry(one, frames) for one in (*provisional, prior.centre))]
    candidates = [*here, *earlier]
    if before is not None and not before.commands.are_of(candidates):
        before = None
    known = np.full(len(labels), -1) if before is None else before.rows_of(labels)
    others = measurements.subset(order[known < 0])
    joints, deviations = others.joints, frames.deviations(others.deviations)
    commands = CommandedPoses.of(mechanism, others.poses, candidates, branch, joints)
    if before is not None:
        joints, deviations = (
            _with_others(of_before, known, of_others)
            for of_before, of_others in ((before.joints, joints), (before.deviations, deviations))
        )
        commands = before.commands.with_others(known, commands)
    EncoderConsistency(commands, joints, labels, branch, prior.centre, prior.leg_widths(mechanism)).check()
    initial = provisional[-1] if provisional else commands.most_frequent_geometry
    free = mechanism.convention.free_parameters(initial)
    start = _start(before, free, initial, commands, joints, known)
    _require_start_poses(start.found, labels)
    return Problem(
        mechanism=mechanism,
        prior=prior,
        noise=noise.along(frames.base),
        joints=joints,
        deviations=deviations,
        first_rows=first_rows_of(labels[:, 0]),
        commands=commands,
        initial_parameters=free,
        start=start.poses,
        has_start_pose=start.found,
        labels=labels,
        gauges=frames.base,
        systematic=systematic,
        unknowns=unknowns,
    )


def _with_others(of_before: Array, known: NDArray[np.intp], of_others: Array) -> Array:
    """Values (n, ...): those of before in ``known`` rows (n,) of theirs, the others in the rest, -1."""
    values = of_before[known]
    values[known < 0] = of_others
    return values


def _start(
    before: Problem | None,
    free: Array,
    initial: Geometry,
    commands: CommandedPoses,
    joints: Array,
    known: NDArray[np.intp],
) -> ForwardResult:
    """The start poses of records (n): those of a problem before from the same start, the others solved."""
    if before is None or not np.array_equal(before.initial_parameters, free):
        return commands.solve_poses(initial, joints)
    new = np.flatnonzero(known < 0)
    solved = commands[new].solve_poses(initial, joints[new])
    found = before.has_start_pose[known]
    found[new] = solved.found
    return ForwardResult(before.start[known].with_rows(new, solved.poses), found)


def _require_start_poses(found: Mask, labels: NDArray[np.int_]) -> None:
    """Require a start pose for at least half of the records; the solver leaves the others out."""
    missing = np.flatnonzero(~found)
    if 2 * len(missing) <= len(found):
        return
    point, orientation = labels[missing[0]]
    raise IdentifiabilityError(
        f"in {len(missing)} of {len(found)} records a singularity lies between the commanded pose and the "
        f"joint variables; the first is point {point}, orientation {orientation}",
        action="Check that q1 to q6 belong to these poses, and the poses to this controller's config",
    )
