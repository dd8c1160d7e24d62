"""Doing a step: with the devices, the disk or the mathematics. Each gives the events it caused."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

import numpy as np

from drivers.gauges.errors import GaugeAtEnd
from hexacell.acceptance import gates
from hexacell.archive import RunFolder
from hexacell.assessment import assess
from hexacell.cell.file import Cell
from hexacell.clock import CellClock
from hexacell.controller_config.proposal import Proposal, propose
from hexacell.controller_config.write_back import Receipt, commit, rollback
from hexacell.errors import HexacellError, LimitError, WriteBackUndone
from hexacell.measurement_file import write_measurements
from hexacell.pose import Pose
from hexacell.robot import config_format
from hexacell.rotations import Array
from hexacell.summary import assessment_document, identification_document, outcome_line
from hexacell.verification import Spread, Verdict, judge
from procedures import events
from procedures.calibration import Calibration, Mode
from procedures.devices import Devices, consists_of, gathered
from procedures.operators import Operator
from procedures.settling import Settled, settle
from procedures.state import RunState
from procedures.steps import CloseSet, Compute, Move, Phase, Place, Sample, Step
from procedures.uninterrupted import uninterrupted

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Performer:
    """Everything a step may need."""

    cell: Cell
    calibration: Calibration
    devices: Devices
    clock: CellClock
    operator: Operator
    folder: RunFolder

    async def perform(self, step: Step, state: RunState) -> events.Event:
        """Do one step.

        Raises:
            HexacellError: it could not be done; the message says what to do.
        """
        match step:
            case Move():
                await self.devices.controller.move(step.target)
                return events.Arrived(at=step.at, orientation=step.orientation, pose=step.pose)
            case Place():
                return await self._place(step)
            case Sample():
                return await self._sample(step, state)
            case CloseSet():
                return await self._close(step, state)
            case Compute():
                return await self._compute(step, state)

    async def _place(self, step: Place) -> events.Event:
        if self.cell.settings.stations.placement == "by-hand":
            await self.operator.place_gauges(step.at.point, Pose(*step.pose))
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
            reason = f"the ball is {_words(deviation)} mm from its reference, farther than {travel:g} mm"
            return events.Refused(at=step.at, orientation=step.orientation, reason=reason)
        return events.Sampled(
            at=step.at,
            orientation=step.orientation,
            pose=step.pose,
            reading=reading,
            deviation_mm=_three(deviation),
        )

    async def _close(self, step: CloseSet, state: RunState) -> events.Event:
        reading = await self._read()
        zero = state.set(step.at).samples[0].reading
        drift = np.subtract(reading.gauges_mm, zero.gauges_mm)
        await gathered(
            "gauges are not as they were", [mounted.gauge.check() for mounted in self.devices.gauges]
        )
        limit = self.cell.settings.acceptance.drift_mm
        if np.abs(drift).max() > limit:
            raise LimitError(
                f"{step.at}: back at the reference the gauges show {_words(drift)}, more than {limit:g} mm",
                action="A gauge slipped or the machine does not repeat; resume measures this point again",
            )
        return events.SetClosed(at=step.at, drift_mm=_three(drift))

    async def _read(self) -> events.Reading:
        settled = await settle(self.devices, self.cell.settings.timing, self.clock)
        return _reading(self.devices, settled)

    async def _compute(self, step: Compute, state: RunState) -> events.Event:
        match step.kind:
            case "identify":
                return await _in_thread(self._identify, state)
            case "propose":
                return await _in_thread(self._propose, state)
            case "commit":
                return await self._commit(state)
            case "judge":
                return await _in_thread(self._judge, state)
            case "roll back":
                return await self._roll_back()

    def _identify(self, state: RunState) -> events.Event:
        write_measurements(self.folder.measurements, state.measurements())
        identified = self.calibration.identification(state)
        robot = self.calibration.robot
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
        receipt = await _in_thread(commit, proposal, self.folder.path)
        try:
            await self.devices.controller.reload()
        except HexacellError as error:
            await _in_thread(rollback, receipt)
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
        await _in_thread(rollback, Receipt.of(self.folder.path))
        await self.devices.controller.reload()
        return events.RolledBack()


async def _in_thread(
    work: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Result:
    """Work that may write files: who cancels it waits for its end, or it would write behind his back."""
    return await uninterrupted(asyncio.to_thread(work, *args, **kwargs))


def _reading(devices: Devices, settled: Settled) -> events.Reading:
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


def _words(deviation: Array) -> str:
    return ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", deviation, strict=True))
