"""Whether a journal can be that of a run of this cell.

The checksums of a journal show damage, not forgery or a mix-up. What is used of it is therefore checked
before: numbers are those of a robot, sets and poses those of the cell file's plan, and nothing comes before
what it follows from.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hexacell.campaign.pilots import FIRST_PILOT, MOST_TO_A_LIST, pilot_number
from hexacell.cell.fields import LARGEST_NUMBER, LARGEST_TIME_S, GeometryDocument, SixNumbers
from hexacell.cell.measuring import MOST_POINTS, MOST_POSES
from hexacell.cell.model import CellSettings
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import AXES
from hexacell.runs.run_folder import RunFolder
from procedures.journal.journal import RESTORE, Entry, read_entries
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, apply
from procedures.steps import events
from procedures.steps.base import StepOfSet
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.place import Place
from procedures.steps.sample import Sample

LARGEST_COUNT = 2**63 - 1
LARGEST_VARIANCE = 1e12
NOT_THEIR_POINTS = "the held-out poses are not those of the cell file's points"
ANY_NUMBERS = (
    events.Arrived,
    events.Located,
    events.RecordTaken,
    events.RecordRejected,
    events.ReferenceConfirmed,
    events.StandstillRead,
    events.PilotTaken,
    events.ReferenceRepeated,
    events.SetClosed,
    events.SetInvalidated,
    events.NoiseMeasured,
    events.ProvisionalApplied,
)
"""Events whose numbers are all used."""
OF_PILOTS = (Move, Pilot, events.Arrived, events.PilotTaken, events.RecordRejected, events.PoseExcluded)
"""Steps and events that may be about a pilot pose."""


def require_sound(
    history: Iterable[events.Event], settings: CellSettings, journal: Path, *, follows_plan: bool = True
) -> RunState:
    """The state after a recorded history of a run of a cell, which ``journal`` keeps.

    If it ``follows_plan`` the whole run is used, and the cell file is as it was; otherwise only numbers are
    used, and the points of the cell file may be others by now. Raises ``FileError``, with the line, if an
    event cannot be of such a run.
    """
    state = RunState()
    for line, event in enumerate(history, start=1):
        problem = next(_Event(event, state, settings, follows_plan).problems(), None)
        if problem is not None:
            raise FileError(
                f"this line of the journal cannot be of this run: {problem}",
                subject=journal,
                line=line,
                action=RESTORE,
            )
        state = apply(state, event)
    return state


def read_sound(folder: RunFolder, settings: CellSettings) -> tuple[Sequence[Entry], RunState]:
    """The journal of a run and the state after it, for its numbers alone; raises ``FileError``."""
    entries = read_entries(folder.journal)
    history = (entry.event for entry in entries)
    return entries, require_sound(history, settings, folder.journal, follows_plan=False)


@dataclass(frozen=True, slots=True)
class _Event:
    """An event, and the state before it."""

    event: events.Event
    state: RunState
    settings: CellSettings
    follows_plan: bool

    def problems(self) -> Iterator[str]:
        """What cannot be."""
        if self.follows_plan:
            yield from self._order()
        yield from self._place()
        yield from self._numbers()
        yield from self._content()

    def _order(self) -> Iterator[str]:
        event, state = self.event, self.state
        is_first = state.started is None
        if is_first != isinstance(event, events.RunStarted):
            yield "it is no start" if is_first else "the run was started before"
        before = {
            events.Proposed: state.identified,
            events.Committed: state.proposed,
            events.ConfirmationPlanned: state.committed,
            events.ResultAccepted: state.judged and state.judged.verification,
            events.RolledBack: state.proposed,
        }
        if type(event) in before and before[type(event)] is None:
            yield f"'{event.kind}' has nothing that it follows from"
        if state.ended is not None:
            yield "the run was over before"

    def _place(self) -> Iterator[str]:
        """The set that the event is of, and its place in it."""
        event = self.event
        step = event.step if isinstance(event, events.StepBegun | events.Failed) else None
        at = step.at if isinstance(step, StepOfSet) else getattr(event, "at", None)
        if isinstance(at, SetKey) and not 1 <= at.point <= self._points(at.phase):
            yield f"the cell file has no {at.station}"
        orientation = getattr(step, "orientation", getattr(event, "orientation", 1))
        if not 0 <= orientation <= MOST_POSES and not self._is_pilot(orientation):
            yield f"there is no orientation {orientation}"
        if isinstance(event, events.RecordTaken):
            taken = {sample.orientation for sample in self.state.set(event.at).samples}
            if event.orientation in {0, *taken} or (not taken and event.orientation != 1):
                yield f"orientation {event.orientation} is not the next one"
        if isinstance(event, events.PilotTaken):
            due = FIRST_PILOT + len(self.state.set(event.at).pilots)
            if event.orientation != due or not self.state.set(event.at).samples:
                yield f"preliminary pose {pilot_number(event.orientation)} is not the next one"

    def _is_pilot(self, orientation: int) -> bool:
        """Whether a pilot pose is meant, and may be: it is left for, but is no record."""
        event = self.event
        subject = event.step if isinstance(event, events.StepBegun | events.Failed) else event
        number = pilot_number(orientation)
        return isinstance(subject, OF_PILOTS) and number is not None and number <= MOST_TO_A_LIST

    def _points(self, phase: Phase) -> int:
        if not self.follows_plan:
            return MOST_POINTS
        match phase:
            case Phase.IDENTIFY:
                return len(self.settings.identification.points)
            case Phase.LENGTH:
                return 0 if self.settings.length_check is None else self.settings.length_check.mountings
        return len(self.settings.verification.points)

    def _numbers(self) -> Iterator[str]:
        event = self.event
        if isinstance(event, ANY_NUMBERS):
            yield from _out_of_range(
                event.model_dump(), LARGEST_NUMBER, but=("counts", "forecasts", "at_s")
            )
        step = event.step if isinstance(event, events.StepBegun) else None
        if isinstance(step, Move | Place | Sample | Pilot):
            yield from _out_of_range(step.pose, LARGEST_NUMBER)
        reading = event if isinstance(event, events.StandstillRead) else getattr(event, "reading", None)
        counts = () if reading is None else reading.counts
        legs = self.settings.mechanism.joint_count
        is_round = all(len(one) == legs and max(map(abs, one)) <= LARGEST_COUNT for one in counts)
        if reading is not None and not (counts and is_round):
            yield "the encoders have other counts"
        if (at_s := getattr(reading, "at_s", None)) is not None and not 0.0 <= at_s <= LARGEST_TIME_S:
            yield "a reading has no time of a run"

    def _content(self) -> Iterator[str]:
        match self.event:
            case events.RunStarted() as started:
                yield from self._geometries(started.controller, started.taught)
                legs = self.settings.mechanism.joint_count
                yield from _range_problems(started.joint_ranges, "joint ranges", legs)
                yield from _range_problems(started.limits.joints, "joint ranges", legs)
                yield from _range_problems(started.limits.axes, "axes", len(AXES))
                if started.accepted is not None:
                    yield from self._covariance(started.accepted.covariance)
                    yield from _out_of_range(started.accepted.model_dump(exclude={"at"}), LARGEST_VARIANCE)
                    free = len(self.settings.mechanism.convention.free_names)
                    if any(len(row) != free for rows in started.accepted.effects.values() for row in rows):
                        yield "an effect has another size"
            case events.ProvisionalApplied() as applied:
                yield from self._geometries(applied.geometry)
            case events.NoiseMeasured() as measured:
                yield from _noise_problems(measured, self.settings.mechanism.joint_count)
            case events.Identified() as identified:
                yield from self._identified(identified)
            case events.Proposed() as proposed:
                yield from self._geometries(proposed.written)
            case events.ConfirmationPlanned() as planned:
                yield from self._held_out(planned.poses)

    def _identified(self, identified: events.Identified) -> Iterator[str]:
        result, points = identified.result, len(self.settings.verification.points)
        yield from self._geometries(result.geometry)
        yield from self._geometries(result.sigma, is_physical=False)
        yield from self._covariance(result.covariance)
        yield from self._held_out(identified.held_out)
        after = identified.held_out_after
        yield from _out_of_range(after, LARGEST_NUMBER)
        if self.follows_plan and len(after) not in {0, points}:
            yield NOT_THEIR_POINTS
        if any(not math.isfinite(one) for one in (result.chi2, result.residual_rms_mm)):
            yield "its residuals are no numbers"

    def _held_out(self, poses: tuple[tuple[SixNumbers, ...], ...]) -> Iterator[str]:
        yield from _out_of_range(poses, LARGEST_NUMBER)
        if self.follows_plan and not (len(poses) == len(self.settings.verification.points) and any(poses)):
            yield NOT_THEIR_POINTS

    def _geometries(self, *documents: GeometryDocument | None, is_physical: bool = True) -> Iterator[str]:
        parameters = self.settings.mechanism.parameters
        for document in documents:
            if document is None:
                continue
            if set(document) != {kind.symbol for kind in parameters.kinds}:
                yield "a geometry has other parameters"
                continue
            try:
                geometry = Geometry.of(parameters, document)
            except (ValueError, TypeError):
                yield "a geometry has other parameters"
                continue
            yield from _out_of_range(geometry.vector.tolist(), LARGEST_NUMBER)
            lengths = [geometry[kind.symbol] for kind in parameters.kinds if kind.is_positive]
            if is_physical and any((values <= 0.0).any() for values in lengths):
                yield "a geometry has lengths that are not above zero"

    def _covariance(self, rows: tuple[tuple[float, ...], ...]) -> Iterator[str]:
        size = len(self.settings.mechanism.parameters)
        if len(rows) != size or any(len(row) != size for row in rows):
            yield "a covariance has another size"
            return
        yield from _out_of_range(rows, LARGEST_VARIANCE)
        covariance = np.array(rows)
        variances = np.diag(covariance)
        bound = np.sqrt(np.abs(variances)[:, np.newaxis] * np.abs(variances))
        if (variances < 0.0).any() or (np.abs(covariance) > 1.001 * bound + 1e-12).any():
            yield "this is no covariance"


def _range_problems(
    ranges: Sequence[tuple[float, float] | None] | None, what: str, count: int
) -> Iterator[str]:
    if ranges is not None:
        if len(ranges) != count:
            yield f"there are {len(ranges)} {what}, not {count}"
        yield from _out_of_range([one for one in ranges if one is not None], LARGEST_NUMBER)


def _noise_problems(measured: events.NoiseMeasured, legs: int) -> Iterator[str]:
    noise = measured.noise
    if len(noise.encoders) != legs:
        yield f"there are {len(noise.encoders)} encoders, not {legs}"
    if not all(one.record > 0.0 for one in (*noise.gauges, *noise.encoders)):
        yield "an instrument has no noise"
    if not 1 <= noise.windows <= 16:
        yield f"a record is no mean of {noise.windows} windows"


def _out_of_range(value: object, limit: float, but: Iterable[str] = ()) -> Iterator[str]:
    """The first number in a value that is not finite, or too large."""
    found = next((one for one in _numbers_in(value, but) if not abs(one) <= limit), None)
    if found is not None:
        yield f"{found:g} is not within +-{limit:g}"


def _numbers_in(value: Any, but: Iterable[str]) -> Iterator[float]:  # noqa: ANN401 - what an event holds
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in but:
                yield from _numbers_in(inner, but)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _numbers_in(inner, but)
    elif isinstance(value, int | float):
        yield value
