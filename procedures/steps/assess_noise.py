"""Assess noise: what was read at the first reference gives the noise that the run counts with."""

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from hexacell.cell.devices import EncoderSettings
from hexacell.errors import LimitError
from hexacell.kinematics.pose import Pose
from hexacell.noise.measured_noise import MeasuredNoise
from hexacell.noise.noise_assessment import NoiseReadings, assess_noise
from hexacell.noise.standstill import display_step
from procedures.resources.run_resources import RunResources
from procedures.run.state import RunState, SetState
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
        readings = noise_readings(state.set(key), run.settings.encoders)
        measured = NoiseMeasured(at=key, noise=assess_noise(run.calibration.plan, readings))
        _require_travel(run, measured.applied_to(state), readings.reference)
        return measured


def _require_travel(run: RunResources, state: RunState, reference: Pose) -> None:
    """Raise ``LimitError`` where the machine scatters so much that no pose keeps the ball in the travel."""
    needed = run.calibration.known(state).allowances.needed_travel_mm(reference)
    narrowest = min(gauge.travel_mm for gauge in run.settings.gauges)
    travel = min(narrowest, 2.0 * run.settings.limits.gauge_travel_mm)
    if needed <= travel:
        return
    raise LimitError(
        f"this machine does not repeat well enough for gauges of {travel:g} mm: the ball leaves their "
        "travel by chance, wherever it is",
        action=f"Use gauges with a travel of more than {needed:.0f} mm, and state it in gauges.travel_mm "
        "and limits.gauge_travel_mm; or look for play in guides and joints",
    )


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
