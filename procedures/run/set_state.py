"""The state of one set of a run: what was measured at a point with one zero of the gauges."""

from __future__ import annotations

from dataclasses import dataclass, replace

from procedures.run import events
from procedures.run.steps import SixNumbers


@dataclass(frozen=True, slots=True)
class SetState:
    """One set as far as it is measured.

    Attributes:
        samples: those that count, in the order taken; the first is the reference.
        again: orientations and poses of discarded records, which are taken again.
        reference_unverified: the gauges were unwatched; their zero must be verified at the reference.
        standstill: readings at the reference without moving, and ``visits`` of it.
        has_left: the robot has been elsewhere since it was read last.
        pilots: readings elsewhere, which steer the choice of poses; ``piloted`` of them since the reference
            was read last.
        probes: readings beside the reference, which try the gauges; ``tried`` once they have passed, until
            the gauges are unwatched.
    """

    samples: tuple[events.RecordTaken, ...] = ()
    placed: bool = False
    rejections: int = 0
    drift_mm: tuple[float, float, float] | None = None
    again: tuple[tuple[int, SixNumbers], ...] = ()
    reference_unverified: bool = False
    standstill: events.StandstillRead | None = None
    visits: tuple[events.ReferenceRepeated, ...] = ()
    has_left: bool = False
    pilots: tuple[events.PilotTaken, ...] = ()
    piloted: int = 0
    probes: tuple[events.GaugesProbed, ...] = ()
    tried: bool = False

    @property
    def closed(self) -> bool:
        """Whether its reference was read again at the end."""
        return self.drift_mm is not None

    @property
    def next_orientation(self) -> int:
        """The lowest orientation without a record."""
        taken = {sample.orientation for sample in self.samples}
        return next(number for number in range(1, len(taken) + 2) if number not in taken)

    def pose(self, orientation: int) -> SixNumbers | None:
        """The pose of a record taken or to be taken again; None if it is not decided."""
        found = [sample.pose for sample in self.samples if sample.orientation == orientation]
        return found[0] if found else dict(self.again).get(orientation)

    def unverified(self) -> SetState:
        """The same after the gauges were unwatched; a closed set is not affected."""
        if self.closed or not self.samples:
            return self
        return replace(self, reference_unverified=True, probes=(), tried=False)

    def with_sample(self, sample: events.RecordTaken) -> SetState:
        """One more record."""
        again = tuple(pair for pair in self.again if pair[0] != sample.orientation)
        return replace(self, samples=(*self.samples, sample), again=again, has_left=False)

    def with_visit(self, visit: events.ReferenceRepeated) -> SetState:
        """One more visit of the reference."""
        return replace(self, visits=(*self.visits, visit), has_left=False, piloted=0)

    def with_pilot(self, pilot: events.PilotTaken) -> SetState:
        """One more pilot reading."""
        return replace(self, pilots=(*self.pilots, pilot), piloted=self.piloted + 1)

    def with_rejection(self, orientation: int) -> SetState:
        """One more rejected record; its orientation is chosen again."""
        again = tuple(pair for pair in self.again if pair[0] != orientation)
        return replace(self, rejections=self.rejections + 1, again=again)

    def without(self, orientation: int) -> SetState:
        """One record less; a closed set is open again with its reference unverified."""
        kept = tuple(sample for sample in self.samples if sample.orientation != orientation)
        undone = [(s.orientation, s.pose) for s in self.samples if s.orientation == orientation]
        less = replace(self, samples=kept, again=(*self.again, *undone), drift_mm=None)
        return less.unverified() if self.closed else less
