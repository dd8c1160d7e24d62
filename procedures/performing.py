"""Doing a step: with the devices, the disk or the mathematics. Each gives the events it caused."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from drivers.gauges.errors import GaugeAtEnd
from hexacell.acceptance import gates
from hexacell.archive import RunFolder
from hexacell.assessment import assess
from hexacell.cell.file import Cell
from hexacell.clock import CellClock
from hexacell.controller_config.format import ControllerGeometry
from hexacell.controller_config.proposal import Proposal, propose
from hexacell.controller_config.write_back import Receipt, commit, rollback
from hexacell.errors import HexacellError, LimitError, WriteBackUndone
from hexacell.measurement_file import write_measurements
from hexacell.pose import Pose, Poses
from hexacell.robot import config_format
from hexacell.rotations import Array
from hexacell.summary import assessment_document, identification_document, outcome_line
from hexacell.verification import Spread, Verdict, judge
from procedures import events
from procedures.calibration import Calibration, Mode
from procedures.devices import Devices, consists_of, gathered
from procedures.guards.guards import Guards
from procedures.guards.trips import GuardTripped
from procedures.lending import Lending
from procedures.operators import Operator
from procedures.revisiting import in_words, seen_again
from procedures.settling import Settled, settle
from procedures.state import RunState
from procedures.steps import CloseSet, Compute, Locate, Move, Phase, Place, Revisit, Sample, Step
from procedures.temperatures import Thermometers
from procedures.uninterrupted import in_thread


@dataclass(frozen=True, eq=False)
class Performer:
    """Everything a step may need."""

    cell: Cell
    calibration: Calibration
    devices: Devices
    clock: CellClock
    operator: Operator
    folder: RunFolder
    thermometers: Thermometers = field(default_factory=Thermometers)

    @cached_property
    def guards(self) -> Guards:
        """What stops the robot when something is wrong; what they latch lasts as long as this."""
        return Guards(self.cell.settings, self.devices, self.clock, self.folder.path)

    @cached_property
    def lending(self) -> Lending:
        """Lends the controller a geometry, and takes it back."""
        return Lending(self.cell, self.calibration, self.guards, self.folder)

    async def prepare(self) -> None:
        """Make the controller ready to move; raises ``HexacellError``."""
        await self.guards.prepare()

    async def perform(self, step: Step, state: RunState) -> events.Event:  # noqa: PLR0911 - a case a step
        """Do one step.

        Raises:
            HexacellError: it could not be done; the message says what to do.
        """
        match step:
            case Locate():
                return events.Located(pose=(await self.devices.controller.pose()).as_tuple())
            case Move():
                return await self._move(step, state)
            case Place():
                return await self._place(step)
            case Sample():
                return await self._sample(step, state)
            case Revisit():
                return await self._revisit(step, state)
            case CloseSet():
                return await self._close(step, state)
            case Compute():
                return await self._compute(step, state)

    async def _move(self, step: Move, state: RunState) -> events.Event:
        try:
            await self.guards.move(step, state, lambda: self._commanded(step, lending=state.lending))
        except GuardTripped as tripped:
            if step.at.phase is not Phase.AFTER or not tripped.trip.is_about_the_ball:
                raise
            # The new geometry takes the ball off its plate: that is a verdict, and it is rolled back.
            self.guards.watch.clear()
            return events.Refused(at=step.at, orientation=step.orientation, reason=str(tripped))
        return events.Arrived(at=step.at, orientation=step.orientation, pose=step.pose)

    def _commanded(self, step: Move, *, lending: bool) -> Array:
        """Where the sliders (6,), mm, belong by the geometry that the controller has now."""
        robot = self.calibration.robot
        commanding = ControllerGeometry(robot.controller, robot.branch)
        if lending or step.at.phase is Phase.AFTER:
            commanding = config_format(self.cell.settings).read(self.cell.config_path)
        target = Poses.of([step.target])
        joints: Array = robot.mechanism.inverse(commanding.geometry, commanding.branch, target)[0]
        return joints

    async def _place(self, step: Place) -> events.Event:
        if self.cell.settings.stations.placement == "by-hand":
            await self.guards.stand(lambda: self.operator.place_gauges(step.at.point, Pose(*step.pose)))
        return events.Placed(at=step.at)

    async def _sample(self, step: Sample, state: RunState) -> events.Event:
        try:
            reading = await self._read()
        except HexacellError as error:
            if not consists_of(error, GaugeAtEnd):
                raise
            return events.Refused(at=step.at, orientation=step.orientation, reason=str(error))
        samples = state.set(step.at).samples
        zero = samples[0].reading if samples else reading
        deviation = np.subtract(reading.gauges_mm, zero.gauges_mm)
        travel = self.cell.settings.limits.gauge_travel_mm
        if np.abs(deviation).max() > travel:
            reason = f"the ball is {in_words(deviation)} mm from its reference, farther than {travel:g} mm"
            return events.Refused(at=step.at, orientation=step.orientation, reason=reason, reading=reading)
        return events.Sampled(
            at=step.at,
            orientation=step.orientation,
            pose=step.pose,
            reading=reading,
            deviation_mm=_three(deviation),
        )

    async def _revisit(self, step: Revisit, state: RunState) -> events.Event:
        try:
            reading = await self._read()
        except HexacellError as error:
            if not consists_of(error, GaugeAtEnd):
                raise
            return events.SetVoided(at=step.at, reason=str(error))
        await self._check_gauges()
        return seen_again(step.at, state.set(step.at).samples[0].reading, reading, self.agreement_mm)

    @property
    def agreement_mm(self) -> float:
        """The largest change of a reference with which a set goes on after an interruption."""
        return self.cell.settings.recovery.agreement_mm

    async def _check_gauges(self) -> None:
        checks = [mounted.gauge.check() for mounted in self.devices.gauges]
        await gathered("gauges are not as they were", checks)

    async def _close(self, step: CloseSet, state: RunState) -> events.Event:
        reading = await self._read()
        zero = state.set(step.at).samples[0].reading
        drift = np.subtract(reading.gauges_mm, zero.gauges_mm)
        await self._check_gauges()
        if drifted := self.guards.drift(str(step.at), _three(drift)):
            raise drifted
        return events.SetClosed(at=step.at, drift_mm=_three(drift), reading=reading)

    async def _read(self) -> events.Reading:
        timing = self.cell.settings.timing
        settled = await self.guards.sample(lambda: settle(self.devices, timing, self.clock))
        return _reading(self.devices, settled, await self.thermometers.read())

    async def _compute(self, step: Compute, state: RunState) -> events.Event:
        match step.kind:
            case "identify":
                return await in_thread(self._identify, state)
            case "propose":
                return await in_thread(self._propose, state)
            case "judge":
                return await in_thread(self._judge, state)
            case _:
                return await self._rewritten(step, state)

    async def _rewritten(self, step: Compute, state: RunState) -> events.Event:
        """The controller's config changed, and the controller has read it."""
        match step.kind:
            case "lend":
                return await self.lending.lend(state)
            case "take back":
                return await self.lending.take_back(state)
            case "commit":
                return await self._commit(state)
            case _:
                return await self._roll_back()

    def _identify(self, state: RunState) -> events.Event:
        write_measurements(self.folder.measurements, state.measurements())
        identified = self.calibration.identification(state)
        robot = self.calibration.robot_of(state)
        assessed = assess(self.cell.settings, robot, state.measurements(), identified)
        document = identification_document(identified)
        self.folder.write_result(document | assessment_document(identified, assessed))
        return events.Identified(result=document, held_out=self.calibration.held_out_poses(identified))

    def _propose(self, state: RunState) -> events.Event:
        identified = self.calibration.identification(state)
        robot, settings = self.calibration.robot, self.cell.settings
        commanding, _ = robot.mechanism.to_convention(robot.controller)
        conditions = gates(
            identified,
            robot.drawing,
            robot.tolerances,
            largest_change_mm=settings.acceptance.largest_change_mm,
            before=commanding,
        )
        proposal = propose(
            self.cell.config_path,
            config_format(settings),
            settings.controller.config_format,
            robot.for_controller(identified.geometry),
            fingerprint_at_start=state.started.config_sha256 if state.started else "",
        )
        proposal.save(self.folder.proposal)
        return events.Proposed(
            gates=tuple(
                events.Gate(name=g.name, passed=g.passed, sentence=g.sentence, needs_person=g.needs_person)
                for g in conditions
            )
        )

    async def _commit(self, state: RunState) -> events.Event:
        conditions = state.proposed.gates if state.proposed else ()
        refused = [gate.sentence for gate in conditions if not gate.passed and not gate.needs_person]
        if refused:
            raise LimitError("the new geometry is refused: " + " ".join(refused))
        proposal = Proposal.load(self.folder.proposal)
        approved_by = await self._approval(conditions, proposal)
        receipt = await in_thread(commit, proposal, self.folder.path)
        try:
            await self.guards.reload()
        except HexacellError as error:
            await in_thread(rollback, receipt)
            raise await self._undone(receipt, error) from error
        return events.Committed(approved_by=approved_by)

    async def _undone(self, receipt: Receipt, error: HexacellError) -> WriteBackUndone:
        """What to raise after a reload that failed, with the old config already back."""
        action = None
        try:
            await self.devices.controller.reload()
        except HexacellError:
            action = "Start the controller anew before it moves: nobody knows which geometry it has"
        return WriteBackUndone(
            f"the controller did not take the new geometry ({error}); its config is as it was",
            subject=receipt.path,
            action=action,
        )

    async def _approval(self, conditions: tuple[events.Gate, ...], proposal: Proposal) -> str:
        automatic = self.cell.settings.acceptance.approval == "automatic"
        if automatic and all(gate.passed for gate in conditions):
            return "the cell file: within its limits"
        name = await self.operator.approve(conditions, proposal.diff)
        if name is None:
            raise LimitError("the new geometry was declined; nothing was applied")
        return name

    def _judge(self, state: RunState) -> events.Event:
        acceptance = self.cell.settings.acceptance
        before = Spread.of(state.held_out(Phase.BEFORE))
        if self.calibration.mode is Mode.CHECK:
            verdict = judge(
                before, before, mean_mm=acceptance.mean_deviation_mm, largest_mm=acceptance.max_deviation_mm
            )
            return events.Judged(
                verdict=verdict, line=_check_line(before, acceptance.mean_deviation_mm, verdict)
            )
        after = Spread.of(state.held_out(Phase.AFTER))
        verdict = judge(
            before, after, mean_mm=acceptance.mean_deviation_mm, largest_mm=acceptance.max_deviation_mm
        )
        if state.refusals(Phase.AFTER):
            verdict = Verdict.WORSE
        identified = self.calibration.identification(state)
        line = outcome_line(identified, before, after, acceptance.mean_deviation_mm, verdict)
        return events.Judged(verdict=verdict, line=line)

    async def _roll_back(self) -> events.Event:
        await in_thread(rollback, Receipt.of(self.folder.path))
        await self.guards.reload()
        return events.RolledBack()


def _reading(
    devices: Devices, settled: Settled, temperatures: tuple[events.Temperature, ...]
) -> events.Reading:
    means, spreads = settled.gauge_means(), settled.gauge_spread()
    on_axes, spread = np.zeros(3), np.zeros(3)
    for row, mounted in enumerate(devices.gauges):
        on_axes[mounted.axis] = mounted.sign * means[row]
        spread[mounted.axis] = spreads[row]
    q1, q2, q3, q4, q5, q6 = (float(value) for value in settled.joint_means())
    return events.Reading(
        gauges_mm=_three(on_axes),
        spread_mm=_three(spread),
        joints_mm=(q1, q2, q3, q4, q5, q6),
        answers=tuple(tuple(reading.raw for reading in glance.gauges) for glance in settled.window),
        counts=tuple(glance.encoders.counts for glance in settled.window),
        temperatures=temperatures,
    )


def _check_line(found: Spread | None, limit_mm: float, verdict: Verdict) -> str:
    if found is None:
        return f"held-out points: {verdict}"
    return (
        f"{found.poses} poses at held-out points; mean deviation {found.mean_mm:.3f} mm "
        f"(limit {limit_mm:g}): {verdict}"
    )


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
