"""What the systematic effects will make of the error at the task poses, once a plan is carried out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hexacell.campaign.exact_records import exact_records
from hexacell.campaign.task_accuracy import Task
from hexacell.errors import HexacellError
from hexacell.identification.estimator import estimate_online
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot


def planned_systematic_mm(
    robot: Robot, task: Task, sets: Sequence[PoseBatch], earlier: Mapping[str, Array] | None = None
) -> float | None:
    """The standard uncertainty by the systematic effects at the worst task pose, mm.

    It is that of the result of all planned poses, for a robot as its controller has it. Before all of them
    are measured the noise is larger by far. None where no such robot can be identified.

    Args:
        robot: with its effects.
        task: where it counts.
        sets: planned poses at each point, the reference first, in the convention's frames.
        earlier: see :meth:`~hexacell.uncertainty.budget.UncertaintyBudget.of`.
    """
    effects = [effect for effect in robot.effects if effect.size]
    if not effects:
        return 0.0
    records = [
        one for point, poses in enumerate(sets, start=1) for one in exact_records(robot, point, poses)
    ]
    try:
        found = estimate_online(robot.problem(MeasurementSet(tuple(records))))
        budget = task.budget(found, robot.belief(found), effects, earlier)
    except HexacellError:
        return None
    return None if budget is None else budget.systematic_mm
