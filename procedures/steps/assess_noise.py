"""Assess noise: what was read at the first reference gives the noise that the run counts with."""

from dataclasses import replace
from typing import ClassVar, Literal

from hexacell.noise.measured_noise import MeasuredNoise
from hexacell.noise.noise_assessment import assess_noise
from procedures.calibration.repeatability import noise_readings
from procedures.resources.run_resources import RunResources
from procedures.run.state import RunState
from procedures.steps.base import Computation, EventOfSet


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
        before = run.calibration.known(state).allowances
        readings = noise_readings(state.set(key), run.settings.encoders, before)
        measured = NoiseMeasured(at=key, noise=assess_noise(run.calibration.plan, readings))
        run.calibration.known(measured.applied_to(state)).allowances.require_travel(readings.reference)
        return measured
