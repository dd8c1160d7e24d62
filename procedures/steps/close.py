"""Close: the reference of a set is read again at its end; the difference is drift."""

from typing import ClassVar, Literal

import numpy as np

from hexacell.campaign.time_model import TimeKind
from hexacell.identification.problem.random_walk import GaugeWalk
from hexacell.lengths import unit_of
from hexacell.measurements.records import deviation_of
from hexacell.noise.allowances import ReferenceChange
from procedures.calibration.repeatability import drift_by_repeats
from procedures.resources.run_resources import RunResources
from procedures.run.keys import Phase, ThreeNumbers
from procedures.run.readings import Reading, in_words
from procedures.run.state import RunState
from procedures.run.trips import Guard, Trip
from procedures.steps.base import EventOfSet, StepOfSet

DRIFTS = (
    "\nthe gauges drift, by {um:.1f} um (one sigma) from one reading to the next, beyond noise; records "
    "are weighted by that, with references read again as records. Look for draught, lamps, loose mounts"
)


class SetClosed(EventOfSet):
    """The reference was read again.

    ``drift_mm`` is the change of the gauges since they were zeroed, less what the encoders explain. The
    ``reason`` is why the set has fewer records than planned; empty where it has all. ``walk_mm`` is how far
    the gauges drift from one reading to the next (1 sigma), by the ends of all sets; 0 unless significant.
    ``walk_s`` is the mean time between these, by which the drift goes; 0: by their number.
    """

    kind: Literal["closed"] = "closed"
    drift_mm: ThreeNumbers
    reading: Reading
    reason: str = ""
    walk_mm: float = 0.0
    walk_s: float = 0.0

    def applied_to(self, state: RunState) -> RunState:
        walk = GaugeWalk(self.walk_mm, self.walk_s)
        return state.with_changed_set(self.at, drift_mm=self.drift_mm, closing=self.reading, walk=walk)

    def text(self, state: RunState) -> str:
        samples = state.set(self.at).samples
        largest = max(float(np.abs(sample.deviation_mm).max()) for sample in samples)
        drift = float(np.abs(self.drift_mm).max())
        unit = unit_of(largest, drift)
        end = f"\n{self.at.name} ends with {len(samples)} records: {self.reason}" if self.reason else ""
        if self.walk_mm and sum(one.walk.step_mm > 0.0 for one in state.sets.values()) == 1:
            end += DRIFTS.format(um=1e3 * self.walk_mm)
        return (
            f"{self.at.name:24} {len(samples):2} records, "
            f"largest deviation {unit.length(largest)}, drift {unit.length(drift)}{end}"
        )


class CloseSet(StepOfSet):
    """Back at the set's reference pose: read again; the difference is drift.

    The ``reason`` is why the set has fewer records than planned; empty where it has all.
    """

    kind: Literal["close"] = "close"
    reason: str = ""

    outcomes: ClassVar = (SetClosed,)
    takes: ClassVar[TimeKind] = TimeKind.READING
    doing: ClassVar[str] = "reading the reference again, for the drift"

    async def perform(self, run: RunResources, state: RunState) -> SetClosed:
        """Read again; raises ``DriftTripped`` if encoders or gauges show what nothing else explains."""
        reading = await run.read(state)
        change = run.since_reference(state, self.at, reading)
        await run.check_gauges()
        trip = encoder_slip(str(self.at), change, run.settings.mechanism.words.joint_unit)
        if trip := trip or reference_drift(str(self.at), change, run.settings.acceptance.drift_mm):
            raise trip.as_error()  # not latched, as nothing moved
        drift_mm = deviation_of(change.unexplained_mm)
        closed = SetClosed(at=self.at, drift_mm=drift_mm, reading=reading, reason=self.reason)
        walk = state.walk
        if self.at.phase is Phase.IDENTIFY:
            after, known = closed.applied_to(state), run.calibration.known(state)
            walk = drift_by_repeats(run.calibration.plan, after, known.allowances)
        return closed.model_copy(update={"walk_mm": walk.step_mm, "walk_s": walk.interval_s})


def reference_drift(point: str, change: ReferenceChange, limit_mm: float) -> Trip | None:
    """The trip of a set whose gauges show another value at its reference than at its begin."""
    if not change.exceeds(limit_mm):
        return None
    return Trip(
        Guard.DRIFT,
        point,
        f"back at the reference the gauges show {in_words(change.unexplained_mm)} that the encoders do not "
        f"explain, more than {limit_mm:g} mm",
        "A gauge slipped, or something moved; resume measures this point again",
    )


def encoder_slip(point: str, change: ReferenceChange, unit: str) -> Trip | None:
    """The trip of a set at whose end an encoder shows another place than the gauges."""
    if (leg := change.slipped_encoder()) is None:
        return None
    return Trip(
        Guard.DRIFT,
        f"encoder {leg + 1}",
        f"{point}: back at the reference {slip_in_words(change, leg, unit)}",
        "It slipped or lost counts: see to its mount, scale and cable. Resume measures this point again; "
        "points before it have its old zero, so begin a new run if it stays there",
    )


def slip_in_words(change: ReferenceChange, leg: int, unit: str) -> str:
    """What an encoder that slipped shows back at a reference."""
    limit, moved = change.chance_joints[leg], change.joints[leg]
    shown_in = unit_of(limit, moved, unit=unit)
    return (
        f"q{leg + 1} shows {shown_in.length(moved, '+')}, more than {shown_in.number(limit)} by chance, "
        "and the gauges deny that it moved"
    )
