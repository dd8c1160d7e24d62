"""First-order propagation of effects: through the estimator, and directly at the task poses.

An effect that moves the ball by e in the records is taken for a deviation. The estimate then errs by

    dp = C (J~^T W e + L dp'),

with C the covariance of the estimate, J~ the centred Jacobian, L the precision of the prior, and dp' the
error of the earlier estimate if that is the prior. A controller with that geometry sets joint variables
at which the robot is ``D e' - H dp`` beside the commanded pose: the effect itself, less what the estimate
had taken up of it, with base and platform frames fitted to both over the workspace. Constant causes are
the same in both, so that their columns are added, never averaged away. What an effect adds to the
chi-square is ``e^T M e``, with M the weights less what stations and parameters absorb.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics import pose_accuracy
from hexacell.identification.diagnostics.frame_alignment import FrameFit
from hexacell.identification.identified_zeros import IdentifiedZeros
from hexacell.identification.placement import Placement
from hexacell.identification.solver.measurement_model import NuisanceElimination
from hexacell.identification.solver.result import Identification
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.identification.terms.term import ErrorsOfSizes, ModelTerm
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effect_kinds import COMMON_SCALE, common_encoder_scale
from hexacell.uncertainty.effects import THOUSANDTH, Effect, Occurrence, errors_of_records


@dataclass(frozen=True, slots=True, eq=False)
class TaskColumns:
    """Errors (t, 6, k) at t task poses, mm and rad, by one unit of each cause of an effect.

    Attributes:
        through: through the result; of the opposite sign of the parameters' errors.
        combined: of both together. Where they have the same cause, they partly cancel.
    """

    through: Array
    direct: Array
    combined: Array


@dataclass(frozen=True, eq=False)
class Propagation:
    """The linear maps at one identification, whose estimate reaches all poses of task and workspace.

    Attributes:
        earlier: the :meth:`parameter_columns` of the estimate that was the prior, by the names of the
            effects; empty where the prior is a drawing.
        zeros: these alone are identified; None where all parameters are.
    """

    found: Identification
    belief: RobotBelief
    task_poses: PoseBatch
    workspace_poses: PoseBatch
    earlier: Mapping[str, Array] = field(default_factory=dict)
    zeros: IdentifiedZeros | None = None

    @cached_property
    def task(self) -> Placement:
        """The robot at the task poses."""
        return pose_accuracy.placement_of(self.belief, self.task_poses)

    @cached_property
    def workspace(self) -> Placement:
        """The robot at the poses over which the frames are fitted."""
        return pose_accuracy.placement_of(self.belief, self.workspace_poses)

    @cached_property
    def frames(self) -> FrameFit:
        """The frames that are fitted."""
        return pose_accuracy.teachable_frames(self.belief, self.workspace_poses)

    @cached_property
    def jacobian(self) -> Array:
        """(t, 6, p) of the errors at the task poses by the free parameters."""
        return pose_accuracy.error_jacobian(self.belief, self.task_poses, self.workspace_poses)

    @cached_property
    def _elimination(self) -> NuisanceElimination:
        return NuisanceElimination(self.found.problem, self.found.prediction.weights)

    @cached_property
    def _kept_covariance(self) -> Array:
        """(p, p): the covariance of the estimate, projected where zeros alone are identified."""
        kept = np.eye(len(self.found.free)) if self.zeros is None else self.zeros.projector
        return np.asarray(kept @ self.found.free_covariance)

    @cached_property
    def _gain(self) -> Array:
        """(p, n, 3) errors of the free parameters by errors of the records, mm."""
        prediction = self.found.prediction
        weighted = np.swapaxes(self._elimination.centred(prediction.jacobian), -1, -2) @ prediction.weights
        return np.asarray(np.einsum("pq,nqa->pna", self._kept_covariance, weighted))

    def parameter_columns(self, effect: Effect) -> Array:
        """Errors (p, k) of the free parameters by one unit of each cause of an effect."""
        if not effect.occurrence.is_in_records:
            return np.zeros((len(self._gain), 0))
        each: Array = np.einsum("pna,nak->pnk", self._gain, errors_of_records(effect, self.found.placement))
        before = None
        if effect.name in self.earlier:
            before = self._kept_covariance @ self.found.active_prior @ self.earlier[effect.name]
        if effect.occurrence is Occurrence.EVERY_STOP:
            stops = each.reshape(len(each), -1)
            return compressed(stops if before is None else np.concatenate([before, stops], axis=-1))
        together: Array = each.sum(axis=1)
        return together if before is None else before + together

    def columns(self, effect: Effect) -> TaskColumns:
        """What an effect does at the task poses."""
        through = -np.tensordot(self.jacobian, self.parameter_columns(effect), axes=1)
        direct = self._direct(effect)
        if effect.occurrence is Occurrence.CONSTANT:
            return TaskColumns(through, direct, through + direct)
        return TaskColumns(through, direct, np.concatenate([through, direct], axis=-1))

    def chi_square(self, effect: Effect) -> float:
        """What one unit of every cause adds to the expected chi-square of the residuals."""
        if not effect.occurrence.is_in_records:
            return 0.0
        errors = errors_of_records(effect, self.found.placement)
        if effect.occurrence is Occurrence.EVERY_STOP:
            errors = each_alone(errors)
        jacobian = self.found.prediction.jacobian
        both = np.concatenate([jacobian, errors], axis=-1)
        rows = self._elimination.system(np.zeros(errors.shape[:2]), both).rows
        by_parameters, by_causes = np.split(rows, [jacobian.shape[-1]], axis=1)
        absorbed = by_parameters.T @ by_causes
        return float(np.sum(by_causes**2) - np.sum(absorbed * (self.found.free_covariance @ absorbed)))

    def by_terms(self, terms: TermEstimates) -> Array:
        """Errors (t, 6, J m) at the task poses by one unit of each coefficient of m terms."""
        return pose_accuracy.errors_by_terms(terms.terms, self.frames, self.task, self.workspace)

    def reversals(self, terms: TermEstimates | None) -> Iterator[Effect]:
        """What nobody knows the side of at work: another error at every stop.

        A controller that corrects backlash knows from which side joints arrive, but nobody where the joints
        of a leg lie that is hardly pulled or pushed.
        """
        if terms is None:
            return
        left = terms.left_by(self.belief.corrections)
        for row, term in enumerate(terms.terms):
            if term.on_either_side is not None:
                rows = terms.rows(row)
                sigma = np.sqrt(np.diag(terms.covariance)[rows])
                sizes = left[rows] if term.needs_directions else terms.values[rows]
                yield _at_every_stop(term, term.on_either_side, np.hypot(sizes, sigma))

    def _direct(self, effect: Effect) -> Array:
        """Errors (t, 6, k) by the effect itself; frames cannot be fitted to what differs at every stop."""
        if effect.on_poses is None or effect.occurrence is Occurrence.MEASURING:
            return np.zeros((len(self.task), 6, 0))
        errors = effect.on_poses(self.task)
        if effect.occurrence in {Occurrence.EVERY_STOP, Occurrence.STOPS_AT_WORK}:
            return each_alone(errors)
        return self.frames.remove_frame_motion(self.task.poses, errors, effect.on_poses(self.workspace))


def _at_every_stop(term: ModelTerm, on_either_side: ErrorsOfSizes, sizes: Array) -> Effect:
    """A term of some sizes (J,) where nobody knows the side."""
    size, unit, at_work = float(np.sqrt(np.mean(sizes**2))), term.unit, Occurrence.STOPS_AT_WORK
    if unit in {*JointUnit}:
        size, unit = size / THOUSANDTH, JointUnit(unit).thousandth

    def columns(at: Placement) -> Array:
        return np.asarray(at.by_legs(on_either_side(at, np.zeros_like(at.joints), sizes)) / size)

    return Effect(f"{term.name} on either side", size, unit, at_work, columns, source="identified")


def each_alone(errors: Array) -> Array:
    """Columns (n, m, n k) in which each of n poses has causes of its own, from those (n, m, k) of each."""
    poses, rows, causes = errors.shape
    alone = np.zeros((poses, rows, poses, causes))
    each = np.arange(poses)
    alone[each, :, each] = errors
    return alone.reshape(poses, rows, -1)


def compressed(columns: Array) -> Array:
    """Columns with the same product with their transpose, at most as many as rows."""
    if columns.shape[1] <= columns.shape[0]:
        return columns
    upper: Array = np.linalg.qr(columns.T)[1]
    return upper.T


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
    through = -pose_accuracy.error_jacobian(belief, task, workspace) @ parameter_columns[COMMON_SCALE]
    assert effect.on_poses is not None  # noqa: S101 - it moves the sliders
    at_task, over = (effect.on_poses(pose_accuracy.placement_of(belief, at)) for at in (task, workspace))
    direct = pose_accuracy.teachable_frames(belief, workspace).remove_frame_motion(task, at_task, over)
    return np.asarray((through + direct)[..., 0])
