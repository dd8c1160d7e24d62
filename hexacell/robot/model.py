"""The model of one robot: what the cell file and the controller's config state together."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import ConfigLayout, controller_geometry
from hexacell.errors import FileError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics.geometry_change import largest_change
from hexacell.identification.diagnostics.tolerance_check import ToleranceViolation, tolerance_violations
from hexacell.identification.identified_zeros import (
    HeldParameters,
    IdentifiedZeros,
    ParameterChoice,
    zero_columns,
)
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import Noise, Prior, Tolerances
from hexacell.identification.problem.problem import Assumptions, Problem
from hexacell.identification.solver.result import GeometryEstimate, Identification
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.identification.terms.term import ModelTerm
from hexacell.identification.thermal_expansion import ThermalExpansion
from hexacell.kinematics.commanded_motion import CommandedRobot, RefusedCommands
from hexacell.kinematics.corrections import NO_CORRECTIONS, CorrectionKind, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism, completed_pose, joint_zeros
from hexacell.kinematics.pose import AXES, FrameTransform, Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.limits.limits import Limits
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.same_robot import require_frames, require_same_robot
from hexacell.robot.stated import noise_of, stated_effects, stated_expansion, stated_limits, stated_terms
from hexacell.uncertainty.effects import Effect, errors_by_effects


@dataclass(frozen=True, eq=False)
class Robot:
    """A mechanism, its drawing, and the geometry that its controller commands with.

    ``controller`` is as the config states it, in the config's own frames, ``drawing`` in those in which
    its tolerances hold; all that is computed is in the mechanism's frame convention.

    Attributes:
        frames: from the controller's frames to the convention's.
        provisional: geometries, in the frame convention, that the controller commanded with for a time
            while measuring.
        uses_provisional: whether it commands with the last of them now.
        known: what is known before measuring, if that is more than the drawing with its tolerances.
        known_effects: what the systematic effects did to that, as errors (p, k) of the free parameters by
            the name of the effect.
        taught: the geometry with which points and frames were taught last, in the frames of that time.
        earlier: geometries that may have commanded older records: the drawing, the taught one, and those
            that the controller had before in the same run.
        work_frame: the axes of the controller's base frame about which a work frame can be taught.
        effects: systematic ones, as they are stated of the machine.
        terms: of the model beside the geometry, which the machine may have.
        known_terms: those that it has, as they were identified before; then no others are looked for.
        corrections: what its controller adds to the inverse kinematics for them; ``holds`` are the kinds of
            these that its config has a place for.
        refused: commands that the cell file excludes, and those that the controller refused in this run.
        identifies: which parameters are identified.
        expansion: by temperature, and how warm the identified geometry is.
    """

    mechanism: Mechanism
    drawing: Geometry
    controller: Geometry
    branch: Branch
    tolerances: Tolerances
    noise: Noise
    limits: Limits
    frames: FrameTransform
    taught: Geometry
    provisional: tuple[Geometry, ...] = ()
    uses_provisional: bool = False
    known: Prior | None = None
    known_effects: Mapping[str, Array] = field(default_factory=dict)
    earlier: tuple[CommandingGeometry, ...] = ()
    work_frame: str = "xyz"
    effects: tuple[Effect, ...] = ()
    terms: tuple[ModelTerm, ...] = ()
    known_terms: tuple[ModelTerm, ...] = ()
    corrections: Corrections = NO_CORRECTIONS
    holds: frozenset[CorrectionKind] = frozenset()
    refused: RefusedCommands = field(default_factory=RefusedCommands)
    identifies: ParameterChoice = ParameterChoice.ALL
    expansion: ThermalExpansion = field(default_factory=ThermalExpansion)

    @cached_property
    def _commanding_as_written(self) -> CommandingGeometry:
        """The controller's config, whose frames its commands are in."""
        return CommandingGeometry.of(self.mechanism, self.controller)

    @cached_property
    def commanding(self) -> Geometry:
        """The geometry that the controller commands with now, in the frame convention."""
        return self.provisional[-1] if self.uses_provisional else self._commanding_as_written.geometry

    @property
    def free_parameters(self) -> Array:
        """The free parameters (p,) of the geometry that commands, mm."""
        return self.mechanism.convention.free_parameters(self.commanding)

    def commanded(self, actual: Geometry) -> CommandedRobot:
        """This robot under its controller, with an ``actual`` geometry in the convention's frames."""
        return CommandedRobot(self.mechanism, self.branch, self.commanding, actual)

    @cached_property
    def prior(self) -> Prior:
        """What is known before measuring."""
        return self.known or Prior.of(self.mechanism, self.drawing, self.tolerances)

    def tolerance_violations(self, found: GeometryEstimate) -> tuple[ToleranceViolation, ...]:
        """The parameters of an estimate that are outside the drawing's tolerances."""
        return tolerance_violations(found, self.mechanism, self.drawing, self.tolerances)

    def largest_change(self, geometry: Geometry) -> float:
        """The largest change of a parameter of the controller's to a geometry in the convention, mm."""
        return largest_change(self.mechanism, self.controller, geometry, self.tolerances)

    def identified_zeros(self, found: Identification) -> IdentifiedZeros | None:
        """The zeros by an identification's records, where these alone are identified."""
        return None if self.held is None else IdentifiedZeros.of(found, self.controller)

    @cached_property
    def held(self) -> HeldParameters | None:
        """The parameters that are not identified; None where all are."""
        if self.identifies is ParameterChoice.ALL:
            return None
        return HeldParameters(zero_columns(self.mechanism, self.controller), self.prior.covariance)

    @cached_property
    def unknowns(self) -> int:
        """How many parameters are identified."""
        names = self.mechanism.convention.free_names
        return len(names) if self.held is None else int(self.held.columns.shape[1])

    def problem(self, measurements: MeasurementSet, before: Problem | None = None) -> Problem:
        """The identification problem of records that were commanded with the controller's geometries.

        It takes less time with the problem ``before`` of some of these records.
        """
        looks_for_terms = self.identifies is ParameterChoice.ALL and not self.known_terms
        assumptions = Assumptions(
            self.mechanism,
            self._commanding_as_written,
            self.branch,
            self.prior,
            self.noise,
            provisional=self.provisional,
            earlier=self.earlier,
            systematic=partial(errors_by_effects, self.effects),
            unknowns=self.unknowns,
            travel_mm=self.limits.travels_mm,
            offered=self.terms if looks_for_terms else (),
            known_terms=self.known_terms,
            expansion=self.expansion,
        )
        return assumptions.problem(measurements, before)

    def belief(self, identified: Identification | None = None) -> RobotBelief:
        """What is known of the robot: by an identification, or by its drawing alone."""
        free, covariance, terms = self.prior.free, self.prior.covariance, None
        if identified is not None:
            free, covariance, terms = identified.free, identified.free_covariance, identified.terms
        elif self.known_terms:
            terms = TermEstimates.expected(self.known_terms, len(free))
        return RobotBelief(
            self.mechanism,
            self.commanding,
            self.branch,
            free,
            covariance,
            self.noise.along(self.frames.base),
            self.limits,
            self.frames.base[:, ["xyz".index(axis) for axis in self.work_frame]].T,
            self.refused,
            self.corrections,
            terms,
        )

    def with_errors_of(self, settings: CellSettings) -> "Robot":
        """The robot with the noise and the systematic effects that some settings state."""
        effects, terms = stated_effects(settings), stated_terms(settings)
        return replace(self, noise=noise_of(settings), effects=effects, terms=terms)

    def for_controller(self, geometry: Geometry) -> Geometry:
        """A geometry in the convention's frames, in the frames of the controller's config."""
        return self.mechanism.change_frames(geometry, self.frames.inverse())

    def with_controller(self, written: Geometry, corrections: Corrections | None = None) -> "Robot":
        """The robot once its controller has a ``written`` geometry, in frames of that geometry's own.

        Without ``corrections`` the controller keeps those that it has.
        """
        own = self._commanding_as_written.geometry
        before = (CommandingGeometry(one, self.frames) for one in (own, *self.provisional))
        frames = self.mechanism.normalize_frames(written)[1]
        return replace(
            self,
            controller=written,
            frames=frames,
            limits=replace(self.limits_with(written), frames=frames),
            provisional=(),
            uses_provisional=False,
            corrections=self.corrections if corrections is None else corrections,
            earlier=(*before, *self.earlier),
        )

    def with_provisional(self, geometry: Geometry, *, is_used: bool = True) -> "Robot":
        """The robot once its controller was given a geometry in the convention's frames for a while.

        It commands with it, unless it has its own back (``is_used`` is false).
        """
        commanding = self.for_controller(geometry) if is_used else self.controller
        return replace(
            self, provisional=(geometry,), uses_provisional=is_used, limits=self.limits_with(commanding)
        )

    def limits_with(self, commanding: Geometry) -> Limits:
        """The limits where the controller has a geometry, in its own frames."""
        return self.limits.with_zeros(joint_zeros(self.mechanism, commanding))

    def from_commands(self, commands: Iterable[Pose]) -> PoseBatch:
        """Poses (n) commanded in the controller's frames, in the convention's frames."""
        commanded = PoseBatch.of(commands)
        if self.mechanism.joint_count < len(AXES):
            commanded = self.mechanism.completed(self.for_controller(self.commanding), commanded)
        return self.frames.poses(commanded)

    def to_command(self, pose: Pose) -> Pose:
        """A pose in the convention's frames, in the controller's frames."""
        command = self.frames.inverse().poses(PoseBatch.of([pose])).pose(0)
        return completed_pose(self.mechanism, self.for_controller(self.commanding), command)


def robot_of(cell: Cell) -> Robot:
    """The robot of a cell, with the geometry its controller's config holds now.

    Raises:
        FileError: the config, or that of the time of teaching, is absent or does not hold a geometry.
    """
    controller = controller_geometry(cell)
    taught = ConfigLayout.of(cell.settings).read(*cell.taught_paths)
    if taught.branch != controller.branch:
        raise FileError(
            "its branch is not that of the controller's config, so it is not of this robot",
            subject=cell.taught_path,
            action="Copy the config there when you teach points and frames, or remove `taught`",
        )
    nominal = cell.settings.drawing
    for geometry, path in ((controller.geometry, cell.config_path), (taught.geometry, cell.taught_path)):
        require_frames(cell.settings.mechanism, geometry, path)
    require_frames(cell.settings.mechanism, nominal, cell.path, cell.document.line_of(("robot", "nominal")))
    require_same_robot(cell, nominal, controller.geometry)
    return make_robot(cell.settings, controller, taught=taught.geometry)


def make_robot(
    settings: CellSettings, controller: ControllerGeometry, *, taught: Geometry | None = None
) -> Robot:
    """The robot of a cell's settings and a controller geometry.

    ``taught`` is the geometry with which points and frames were taught; by default the controller's.
    """
    mechanism, nominal = settings.mechanism, settings.drawing
    drawn = CommandingGeometry.of(mechanism, nominal)
    frames = mechanism.normalize_frames(controller.geometry)[1]
    return Robot(
        mechanism=mechanism,
        drawing=nominal,
        controller=controller.geometry,
        branch=controller.branch,
        tolerances=Tolerances.of_settings(mechanism.parameters, settings.tolerances.model_dump()),
        noise=noise_of(settings),
        limits=stated_limits(settings, controller, frames),
        frames=frames,
        taught=controller.geometry if taught is None else taught,
        earlier=(drawn,) if taught is None else (drawn, CommandingGeometry.of(mechanism, taught)),
        work_frame=settings.task.work_frame,
        effects=stated_effects(settings),
        terms=stated_terms(settings),
        corrections=controller.corrections,
        holds=controller.holds,
        refused=settings.excluded_commands,
        identifies=(ParameterChoice.ZEROS if settings.identification.only_zeros else ParameterChoice.ALL),
        expansion=stated_expansion(settings),
    )
