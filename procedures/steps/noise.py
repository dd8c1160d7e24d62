"""Standstill, repeat and assess noise: the run counts with the noise that its first reference shows."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from hexacell.cell.devices import EncoderSettings
from hexacell.kinematics.pose import Pose
from hexacell.noise.measured_noise import MeasuredNoise
from hexacell.noise.noise_assessment import NoiseReadings, assess_noise
from hexacell.noise.standstill import display_step
from procedures.resources.run_resources import RunResources
from procedures.run.keys import SetKey
from procedures.run.readings import Reading, ReadingSeries
from procedures.run.state import RunState, SetState
from procedures.steps.base import BaseEvent, Computation, EventOfSet, StepOfSet


class StandstillRead(ReadingSeries, BaseEvent):
    """The devices were read again and again at a reference while nothing moved."""

    kind: Literal["stood"] = "stood"
    at: SetKey

    def applied_to(self, state: RunState) -> RunState:
        return state.with_set(self.at, replace(state.set(self.at), standstill=self))


class Standstill(StepOfSet):
    """At a set's reference: read all devices again and again without moving, which shows their noise."""

    kind: Literal["standstill"] = "standstill"

    outcomes: ClassVar = (StandstillRead,)
    purpose: ClassVar[str] = "measuring the noise"

    async def perform(self, run: RunResources, state: RunState) -> StandstillRead:
        series = await run.read_series(run.settings.noise.standstill_readings)
        return StandstillRead(at=self.at, **dict(series))


class ReferenceRepeated(EventOfSet):
    """The reference was left, visited again from another direction, and read."""

    kind: Literal["repeated"] = "repeated"
    reading: Reading

    def applied_to(self, state: RunState) -> RunState:
        measured = state.set(self.at)
        visits = (*measured.visits, self)
        return state.with_set(self.at, replace(measured, visits=visits, has_left=False, piloted=0))


class Repeat(StepOfSet):
    """Back at a set's reference from another direction: read again, which shows how well it repeats."""

    kind: Literal["repeat"] = "repeat"

    outcomes: ClassVar = (ReferenceRepeated,)
    purpose: ClassVar[str] = "measuring the noise"

    async def perform(self, run: RunResources, state: RunState) -> ReferenceRepeated:
        return ReferenceRepeated(at=self.at, reading=await run.read())


class NoiseMeasured(EventOfSet):
    """The noise of gauges and encoders that the run counts with from now on.

    If records are the mean of several windows from now on, the set's reference is recorded again.
    """

    kind: Literal["noise measured"] = "noise measured"
    noise: MeasuredNoise

    def applied_to(self, state: RunState) -> RunState:
        """The reference is recorded again where later records are means of more windows."""
        measured = state.set(self.at)
        again = () if self.noise.windows > 1 else measured.samples
        return replace(state, noise=self).with_set(self.at, replace(measured, samples=again))


class AssessNoise(Computation):
    """Evaluate what was read at rest and at each visit of the first reference."""

    kind: Literal["assess noise"] = "assess noise"

    outcomes: ClassVar = (NoiseMeasured,)
    doing: ClassVar[str] = "evaluating the noise"

    def compute(self, run: RunResources, state: RunState) -> NoiseMeasured:
        assert state.at_pose is not None  # noqa: S101 - decided only at the reference
        key, _ = state.at_pose
        readings = noise_readings(state.set(key), run.settings.encoders)
        return NoiseMeasured(at=key, noise=assess_noise(run.calibration.plan, readings))


def noise_readings(measured: SetState, encoders: EncoderSettings) -> NoiseReadings:
    """What was read at the reference of a set."""
    zero, series = measured.samples[0], measured.standstill
    gauges = [] if series is None else series.gauges_mm
    joints = [] if series is None else series.joints
    answers = zero.reading.answers if series is None else series.answers
    steps = [display_step([one[gauge] for one in answers]) for gauge in range(3)]
    visits = [zero.reading, *(visit.reading for visit in measured.visits)]
    return NoiseReadings(
        reference=Pose(*zero.pose),
        series=np.concatenate([np.reshape(gauges, (-1, 3)), np.reshape(joints, (-1, 6))], axis=1),
        steps=np.array([*steps, *(encoders.step,) * 6]),
        visits=np.array([(*reading.gauges_mm, *reading.joints) for reading in visits]),
        window_readings=len(zero.reading.counts),
    )
