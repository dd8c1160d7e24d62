"""What a length check tells an uncertainty budget of the error that all encoders have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics.pose_accuracy import error_jacobian, teachable_frames
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import Effect, Occurrence
from hexacell.uncertainty.encoder_effects import COMMON_SCALE, common_encoder_scale
from hexacell.uncertainty.propagation import Propagation, TaskColumns, placement_of


@dataclass(frozen=True, slots=True, eq=False)
class ScaleObservation:
    """How much farther the sliders move than all encoders show, um/m, and what is not known of that.

    The judged geometry and the check err in part by the same causes. By these parts the observation is
    beside the truth together with the errors at the task.

    Attributes:
        farther_um_m: the value; encoders that show too much have a negative one.
        sigma_um_m: one standard deviation by causes that it shares with nothing else.
        by_parameters: (p,) its error by errors of the free parameters.
        by_effects: (k,) its error by one unit of each cause of an effect that it shares, by the name.
    """

    farther_um_m: float
    sigma_um_m: float
    by_parameters: Array
    by_effects: Mapping[str, Array]

    def by_effect(self, effect: Effect, causes: int) -> Array:
        """Its error (k,) by one unit of each cause of an effect, as many as a budget has of it.

        Where causes act directly, and differ each time, they come last and are not shared.
        """
        shared = self.by_effects.get(effect.name, np.zeros(0))
        if effect.occurrence is Occurrence.CONSTANT and len(shared) not in {0, causes}:
            raise ValueError(effect.name)
        return np.concatenate([shared, np.zeros(causes - len(shared))])


def errors_by_scale(
    belief: RobotBelief, task: PoseBatch, workspace: PoseBatch, parameter_columns: Mapping[str, Array]
) -> Array:
    """Errors (t, 6) at task poses by 1 um/m, mm and rad, through the geometry and directly.

    ``parameter_columns`` has what that did to the free parameters (p, 1). Frames are fitted over the
    workspace.
    """
    effect = common_encoder_scale(1.0)
    through = -error_jacobian(belief, task, workspace) @ parameter_columns[COMMON_SCALE]
    assert effect.on_poses is not None  # noqa: S101 - it moves the sliders
    at_task, over = (effect.on_poses(placement_of(belief, poses)) for poses in (task, workspace))
    direct = teachable_frames(belief, workspace).remove_frame_motion(task, at_task, over)
    errors: Array = (through + direct)[..., 0]
    return errors


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredScale:
    """What a measured scale common to all encoders does at t task poses; nothing without a measurement.

    Attributes:
        unit: (t, 6) errors by 1 um/m, mm and rad.
    """

    unit: Array
    scale: ScaleObservation | None

    @classmethod
    def of(cls, propagation: Propagation, scale: ScaleObservation | None) -> MeasuredScale:
        """At the task of a propagation."""
        if scale is None:
            return cls(np.zeros(propagation.jacobian.shape[:2]), None)
        return cls(propagation.columns(common_encoder_scale(1.0)).combined[..., 0], scale)

    @property
    def known(self) -> Array:
        """(t, 6) by the measured value."""
        return self.unit * (0.0 if self.scale is None else self.scale.farther_um_m)

    def by_parameters(self, columns: Array) -> Array:
        """(t, 6, k) by errors (p, k) of the free parameters, of the sign of the jacobian."""
        if self.scale is None:
            return np.zeros((*self.unit.shape, columns.shape[-1]))
        return self.unit[..., None] * (self.scale.by_parameters @ columns)

    def combined(self, effect: Effect, task: TaskColumns) -> Array:
        """Errors (t, 6, k) by one unit of each cause of an effect, less what is taken for a scale."""
        if self.scale is None or effect.name == COMMON_SCALE:
            return task.combined
        taken = self.scale.by_effect(effect, task.combined.shape[-1])
        return task.combined - self.unit[..., None] * taken
