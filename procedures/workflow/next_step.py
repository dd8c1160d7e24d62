"""The next step of a calibration, decided from the state of the run and nothing else.

The points are measured (:mod:`~procedures.workflow.points`) and the geometry is identified. The held-out
points are measured (:mod:`~procedures.workflow.held_out`), the geometry is written to the controller, and
the held-out points are measured again. A check only measures points. A length check, of its own or before
the verdict on a calibration, measures two seats (:mod:`~procedures.workflow.length`).
"""

from dataclasses import dataclass

from hexacell.campaign.planner import Plan
from hexacell.errors import HexacellError
from hexacell.kinematics.pose import Pose
from hexacell.motion.arrival import least_way
from hexacell.motion.overshoot import clear_waypoint_before, overshoot
from hexacell.noise.allowances import Allowances
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Calibration, Mode
from procedures.resources.run_resources import RunResources
from procedures.run.keys import Phase
from procedures.run.state import RunState
from procedures.steps import events
from procedures.workflow.held_out import HeldOutSteps
from procedures.workflow.length import LengthSteps
from procedures.workflow.points import IdentificationSteps, NoiseSteps
from procedures.workflow.sets import SetSteps


@dataclass(frozen=True, eq=False)
class StepExecutor(RunResources):
    """The resources of a run, with which its steps are carried out."""

    def next_step(self, state: RunState) -> events.BaseStep | None:
        """The step to carry out; None if the run is over. Raises ``HexacellError`` if none is possible."""
        return next_step(self.calibration, state)

    async def perform(self, step: events.BaseStep, state: RunState) -> events.BaseEvent:
        """Carry out one step; raises ``HexacellError``."""
        if not step.moves_nothing:
            await self.require_unedited_config(state)
            self.guards.following = self.calibration.known(state).allowances.following
        return await step.perform(self, state)


def next_step(calibration: Calibration, state: RunState) -> events.BaseStep | None:
    """The step to execute; None if the run is over. Raises ``HexacellError`` if none is possible."""
    if state.ended is not None:
        return None
    if state.config_write_pending:
        return events.TakeBack()
    known = calibration.known(state)
    measuring = Measuring(known.measuring, known.allowances)
    step = _decided(calibration, measuring, state)
    return measuring.from_one_side(step, state) if isinstance(step, events.Move) else step


def _decided(calibration: Calibration, measuring: "Measuring", state: RunState) -> events.BaseStep | None:
    """The step to execute, where a move goes straight to its end."""
    if state.recalled is not None:
        return _way_back(measuring, state)
    if calibration.mode in {Mode.LENGTH, Mode.CHECK}:
        is_length = calibration.mode is Mode.LENGTH
        measure = measuring.length_step if is_length else measuring.points.next_step
        return None if state.judged else measure(state) or events.Judge()
    if state.identified is None:
        step = measuring.points.next_step(state)
        return step or (events.TakeBack() if state.provisional_active else events.Identify())
    before = measuring.held_out.next_step(state, Phase.BEFORE)
    return before or _write_back(measuring, state, has_length_check=calibration.length_check)


class Measuring:
    """The stages that measure, for the geometries that command the robot of a plan.

    Where the cell file wants every stop reached from the same side, joints go from a waypoint to it by
    ``_back``, in their unit, below 0 if they go down; 0 for moves as they are.
    """

    def __init__(self, plan: Plan, allowances: Allowances) -> None:
        settings = plan.settings
        sets = SetSteps(plan.robot, settings, allowances)
        self.points = IdentificationSteps(plan, sets, NoiseSteps(plan, sets))
        self.held_out = HeldOutSteps(len(settings.verification.points), sets)
        least = least_way(settings.mechanism.words.joint_unit, allowances.stops)
        self._sets, self._back = sets, settings.motion.sign * overshoot(least, settings.model.backlash)
        fixture = settings.length_check
        self.length = None if fixture is None else LengthSteps(fixture, sets)

    def length_step(self, state: RunState) -> events.BaseStep | None:
        """The next step of the length check; None when it is done."""
        return None if self.length is None else self.length.next_step(state)

    def from_one_side(self, move: events.Move, state: RunState) -> events.Move:
        """The move over its waypoint, which is checked as the move itself is, or straight without one.

        From which side the joints then arrived is known from the path.
        """
        if not self._back:
            return move
        belief, reference = self._sets.known(state, move.at)
        start = None if state.target is None else self._sets.command(state.target)
        stop = self._sets.command(move.pose)
        waypoint = clear_waypoint_before(belief, start, stop, self._back, reference)
        if waypoint is None:
            return move.model_copy(update={"straight": True})
        pose = self._sets.robot.to_command(waypoint.pose(0)).as_tuple()
        return move.model_copy(update={"waypoint": pose})


def length_poses(calibration: Calibration) -> tuple[tuple[str, Pose], ...]:
    """The poses of the length check of a run with their names; empty without one."""
    steps = Measuring(calibration.plan, calibration.at_start.allowances).length
    is_wanted = calibration.length_check or calibration.mode is Mode.LENGTH
    return steps.planned_poses() if is_wanted and steps is not None else ()


def _way_back(measuring: Measuring, state: RunState) -> events.BaseStep | None:
    """The next move back to the reference of the set in which the robot is; None where there is none.

    Such is a robot that is there, is in no set, is lost, or finds no safe path.
    """
    keys = [key for key in state.open_sets if state.set(key).samples]
    at_reference = state.at_pose is not None and state.at_pose[1] == 1
    if not keys or at_reference or state.position_unknown or state.target is None:
        return None
    key = keys[-1] if state.at_pose is None else state.at_pose[0]
    steps = measuring.points if key.phase is Phase.IDENTIFY else measuring.held_out
    try:
        return steps.way_back(state, key) if key in keys else None
    except HexacellError:
        return None


def _write_back(measuring: Measuring, state: RunState, *, has_length_check: bool) -> events.BaseStep | None:
    """The next step once the held-out points are measured for the first time."""
    if state.proposed is None:
        return events.Propose()
    if state.judged is not None:
        return _after_verdict(state, state.judged)
    if state.rolling_back:
        return events.RollBack()
    if state.committed is None:
        return events.Commit()
    step = measuring.held_out.next_step(state, Phase.AFTER)
    if step is None and has_length_check:
        step = measuring.length_step(state)
    if step is None and state.confirmation is not None:
        step = measuring.held_out.next_step(state, Phase.CONFIRM)
    return step or events.Judge()


def _after_verdict(state: RunState, judged: events.ResultValidated) -> events.BaseStep | None:
    """What follows a verdict on a written geometry: it stays, or a person decides, or it is rolled back."""
    verification = judged.verification
    stays = judged.verdict is Verdict.PASS or (verification is not None and verification.is_kept)
    if stays or state.rolled_back:
        return None
    is_offered = verification is not None and verification.is_offered
    if is_offered and state.accepted is None and not state.rolling_back:
        return events.Accept()
    is_kept = state.accepted is not None and state.accepted.by is not None
    return None if is_kept else events.RollBack()
