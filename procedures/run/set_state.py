"""One set: what is measured of a point, from the zero of its gauges to the reading at its end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hexacell.campaign.pilots import FIRST_REPEAT
from hexacell.identification.problem.random_walk import NO_WALK, GaugeWalk
from hexacell.measurements.records import Record
from procedures.run.keys import SixNumbers
from procedures.run.readings import Reading

if TYPE_CHECKING:  # a set keeps events whole, and needs their names in its annotations alone
    from procedures.steps import events


@dataclass(frozen=True, slots=True)
class SetState:
    """One set as far as it is measured.

    Attributes:
        samples: those that count, in the order taken; the first is the reference.
        again: orientations and poses of discarded records, which are taken again.
        closing: what was read at the reference at the end.
        walk: how the gauges drift, by all sets until then.
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
    closing: Reading | None = None
    walk: GaugeWalk = NO_WALK
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
    def readings(self) -> int:
        """How many readings were taken until now, from which a drift is counted."""
        return sum(map(len, (self.samples, self.visits, self.pilots, self.probes)))

    @property
    def next_orientation(self) -> int:
        """The lowest orientation without a record."""
        taken = {sample.orientation for sample in self.samples}
        return next(number for number in range(1, len(taken) + 2) if number not in taken)

    def pose(self, orientation: int) -> SixNumbers | None:
        """The pose of a record taken or to be taken again; None if it is not decided."""
        found = [sample.pose for sample in self.samples if sample.orientation == orientation]
        return found[0] if found else dict(self.again).get(orientation)

    def with_repeats(self, visits: Sequence[Reading]) -> Iterator[Record]:
        """Its records, and readings of its reference as others: ``visits`` after the first, and the last.

        They are in the order taken, so that they show the way of a drift.
        """
        first, *others = self.samples
        closing = () if self.closing is None else (self.closing,)
        repeats = [
            replace(
                first.record,
                orientation=FIRST_REPEAT + number,
                joints=reading.joints,
                deviation=reading.deviation_from(first.reading),
                directions=reading.directions,
                temperatures=reading.part_temperatures,
                time_s=reading.at_s,
            )
            for number, reading in enumerate((*visits, *closing))
        ]
        taken = (sample.record for sample in others)
        yield from (first.record, *repeats[: len(visits)], *taken, *repeats[len(visits) :])

    def unverified(self) -> SetState:
        """The set after the gauges were unwatched; a closed set is not affected."""
        if self.closed or not self.samples:
            return self
        return replace(self, reference_unverified=True, probes=(), tried=False)

    def with_rejection(self, orientation: int) -> SetState:
        """One more rejected record; its orientation is chosen again."""
        again = tuple(pair for pair in self.again if pair[0] != orientation)
        return replace(self, rejections=self.rejections + 1, again=again)

    def without(self, orientation: int) -> SetState:
        """One record less; a closed set is open again with its reference unverified."""
        kept = tuple(sample for sample in self.samples if sample.orientation != orientation)
        undone = [(s.orientation, s.pose) for s in self.samples if s.orientation == orientation]
        less = replace(self, samples=kept, again=(*self.again, *undone), drift_mm=None, closing=None)
        return less.unverified() if self.closed else less
