"""Replaying a journal reproduces its events; any other event is reported as a difference."""

import asyncio
import itertools
import random
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.errors import GaugeAtEnd
from hexacell.errors import HexacellError, LimitError
from hexacell.services.run.calibration_run import calibration_of_run
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Mode
from procedures.journal.journal import Entry, read_journal
from procedures.replay.recorded_executor import RecordedStepExecutor
from procedures.replay.replayer import Aspect, Replayer, ReplayReport, Scope
from procedures.run.keys import Phase, SetKey
from procedures.run.state import fold
from procedures.steps import events
from tests.procedures.runs.listening import at_step, cancelled, failing, happened, on
from tests.small_cell import changed

Replay = Callable[..., ReplayReport]


def numbered(history: Sequence[events.Event]) -> list[Entry]:
    when = datetime(2026, 11, 20, tzinfo=UTC)
    return [Entry(number, when, float(number), event) for number, event in enumerate(history, 1)]


def through(
    rig: Any, history: Sequence[events.Event], folder: Path, scope: Scope = Scope.ALL
) -> ReplayReport:
    """A history through the procedure of a rig's cell, whose config is as it was at the beginning."""
    folder.mkdir()
    started = history[0]
    assert isinstance(started, events.RunStarted)
    calibration = calibration_of_run(rig.cell, started)
    executor = RecordedStepExecutor.of(rig.cell, calibration, type(rig.folder)(folder))
    report = ReplayReport(rig.folder.journal, "hexacell", len(history))
    asyncio.run(Replayer(executor, report, scope).replay(numbered(history)))
    return report


@pytest.fixture
def replay(make_rig, recording, tmp_path: Path) -> Replay:
    """Replays a history of the recorded cell, or of a rig, on a fresh copy of the cell's config."""

    def run(history: Sequence[events.Event], rig: Any = None, scope: Scope = Scope.ALL) -> ReplayReport:
        rig = rig or make_rig()
        rig.cell.config_path.write_bytes(recording.config_before)
        folder = tmp_path / f"again-{len(list(tmp_path.iterdir()))}"
        return through(rig, history, folder, scope)

    return run


def test_a_run_is_reproduced(recording, replay) -> None:
    report = replay(recording.history)
    begun = [event for event in recording.history if isinstance(event, events.StepBegun)]
    assert report.differences == []
    assert report.decisions == len(begun)
    assert report.results == len(begun) + 1, "every step has its result, and so has the run"
    assert report.taken == 1, "only the beginning is taken as it stands"


@pytest.mark.slow
def test_a_run_of_before_directions_were_kept_is_reproduced(recording, replay) -> None:
    """Its records have none, nothing by them was looked for, and what a replay computes is not compared."""
    history = [type(event).model_validate(without_directions(event)) for event in recording.history]
    assert history != [*recording.history]
    assert not any(record.directions for record in fold(history).measurements().records)
    report = replay(history)
    assert report.differences == []
    assert report.results > 30


def without_directions(event: events.Event) -> Any:
    """The event as it was before directions, and terms that need them, were kept."""

    def kept(part: Any) -> Any:
        if isinstance(part, dict):
            left_out = {"directions", "terms"}
            return {name: kept(value) for name, value in part.items() if name not in left_out}
        return [kept(value) for value in part] if isinstance(part, list) else part

    return kept(event.model_dump(mode="json"))


def test_a_direction_that_does_not_follow_from_the_move_is_a_difference(recording, replay) -> None:
    other = altered(recording.history, events.Arrived, {"directions": (0,) * 6}, 3)
    places = {difference.change.field for difference in replay(other).differences}
    assert any(place.startswith("directions") for place in places)


def test_rejected_records_are_reproduced(make_rig, replay) -> None:
    """One whose plungers were at their ends, and one farther away than the travel allows."""
    rig = make_rig()
    shown = rig.gauges[1].shown

    def at_ends() -> None:
        for gauge in rig.gauges[:2]:
            gauge.failures.append(GaugeAtEnd("is at an end of its travel", subject=f"gauge {gauge.name}"))

    at_third = failing("P1/o03/sample", at_ends)
    at_fifth = failing("P1/o05/sample", lambda: setattr(rig.gauges[1], "shown", lambda: 6.1))
    inside = on(events.RecordRejected, lambda: setattr(rig.gauges[1], "shown", shown), 2)
    asyncio.run(cancelled(rig, partial(at_step, "P1/close"), at_third, at_fifth, inside))
    history = read_journal(rig.folder.journal)
    readings = [event.reading for event in history if isinstance(event, events.RecordRejected)]
    assert [reading is None for reading in readings] == [True, False]
    report = replay(history, rig)
    assert report.differences == []


@pytest.mark.sample("13")
@pytest.mark.parametrize("number", range(1, 26))
def test_a_check_stopped_after_any_event_is_reproduced(make_rig, replay, number: int) -> None:
    rig = make_rig(Mode.CHECK)

    async def history() -> None:
        await cancelled(rig, partial(on, object, count=number))
        await rig.run()

    asyncio.run(history())
    report = replay(read_journal(rig.folder.journal), rig)
    assert report.differences == []
    assert report.results > 10


def test_a_killed_run_is_reproduced(recording, replay) -> None:
    for kind in (events.StepBegun, events.RecordTaken):
        report = replay(recording.until(kind, count=1))
        assert report.differences == []


def test_a_failed_identification_fails_again_with_the_same_message(make_rig, replay) -> None:
    rig = make_rig(identification__orientations=3)
    with pytest.raises(HexacellError, match="12 equations for 35 parameters"):
        asyncio.run(rig.run())
    history = read_journal(rig.folder.journal)
    report = replay(history, rig, Scope.RESULTS)
    assert report.differences == []
    report = replay(altered(history, events.Interrupted, {"reason": "something else"}), rig, Scope.RESULTS)
    [difference] = report.differences
    assert difference.aspect is Aspect.WORDS


def test_answers_of_a_person_are_repeated(recording, replayed, replay) -> None:
    rig = replayed(recording.until(events.Proposed), acceptance__approval="ask")
    rig.operator.name = None
    with pytest.raises(LimitError, match="declined"):
        asyncio.run(rig.run())
    rig.operator.name = "somebody else"
    asyncio.run(cancelled(rig, partial(on, events.Committed)))
    assert "somebody else" in {event.approved_by for event in happened(rig, events.Committed)}
    report = replay(read_journal(rig.folder.journal), rig, Scope.RESULTS)
    assert report.differences == []


def altered(history: Sequence[events.Event], kind: type[Any], changes: dict[str, Any], nth: int = 1) -> Any:
    """A history in which the ``nth`` event of a kind has other values at dotted keys."""
    places = [place for place, event in enumerate(history) if isinstance(event, kind)]
    place = places[nth - 1]
    return [*history[:place], changed(history[place], changes), *history[place + 1 :]]


NOWHERE = (((0.0,) * 6,) * 3,) * 2
MANIPULATIONS: list[tuple[type[Any], dict[str, Any], int, Scope, str]] = [
    (events.RecordTaken, {"deviation_mm": (0.0, 1e-8, 0.0)}, 1, Scope.RESULTS, "deviation_mm[1]"),
    (events.RecordTaken, {"pose": (1.0,) * 6}, 3, Scope.RESULTS, "pose[0]"),
    (events.RecordTaken, {"orientation": 9}, 3, Scope.RESULTS, "orientation"),
    (events.RecordTaken, {"reading.gauges_mm": (0.0,) * 3}, 3, Scope.RESULTS, "deviation_mm[0]"),
    (events.RecordTaken, {"reading.joints": (0.0,) * 6}, 3, Scope.RESULTS, "reading.joints"),
    (events.Arrived, {"pose": (1.0,) * 6}, 2, Scope.RESULTS, "pose[0]"),
    (events.SetClosed, {"drift_mm": (1.0,) * 3}, 2, Scope.RESULTS, "drift_mm[0]"),
    (events.StepBegun, {"step.pose": (1.0,) * 6}, 10, Scope.DECISIONS, "pose[0]"),
    (events.Identified, {"held_out": NOWHERE}, 1, Scope.IDENTIFICATION, "held_out[0][0][0]"),
    (events.Identified, {"result.covariance": ((0.5,),)}, 1, Scope.IDENTIFICATION, "result.covariance"),
    (events.Proposed, {"gates": ()}, 1, Scope.RESULTS, "gates"),
    (events.ResultValidated, {"verdict": Verdict.FAIL}, 1, Scope.RESULTS, "verdict"),
    (events.Ended, {"exit_code": 1}, 1, Scope.ALL, "exit_code"),
]


@pytest.mark.parametrize(("kind", "changes", "nth", "scope", "field"), MANIPULATIONS)
def test_a_manipulated_event_is_reported_with_its_line(recording, replay, kind, changes, nth, scope, field):
    history = altered(recording.history, kind, changes, nth)
    line = next(
        n for n, pair in enumerate(zip(history, recording.history, strict=True), 1) if pair[0] != pair[1]
    )
    report = replay(history[:line], scope=scope)
    first = report.differences[0]
    assert (first.line, first.change.field) == (line, field)
    assert first.aspect is (Aspect.DECISION if scope is Scope.DECISIONS else Aspect.RESULT)
    assert f"line {line}, " in str(first)


@pytest.mark.parametrize("changes", [{"spread_mm": (0.0, 1.0, 0.0)}, {"counts": ((0,) * 6,)}])
def test_a_reading_that_had_not_settled_is_reported(recording, replay, changes: dict[str, Any]) -> None:
    changes = {f"reading.{key}": value for key, value in changes.items()}
    history = altered(recording.until(events.RecordTaken, count=3), events.RecordTaken, changes, 3)
    [first, *_] = replay(history, scope=Scope.RESULTS).differences
    assert "had not settled" in str(first)


def test_one_manipulated_event_or_an_early_end_gives_one_difference(recording, replay) -> None:
    whole = recording.until(events.SetClosed)
    last = sum(isinstance(event, events.Arrived) for event in whole)  # no later move begins there
    history = altered(whole, events.Arrived, {"pose": (100.0, -100.0, 500.0, 1.0, 0.0, 0.0)}, last)
    [line] = (n for n, event in enumerate(history, 1) if event != recording.history[n - 1])
    assert {difference.line for difference in replay(history, scope=Scope.RESULTS).differences} == {line}
    early = [*recording.until(events.SetClosed), recording.history[-1]]
    [difference] = replay(early).differences
    assert difference.aspect is Aspect.DECISION
    assert (difference.change.recorded, difference.change.replayed) == ("ended", "P2/o01/move")


def test_an_event_with_an_external_cause_is_taken_from_the_journal(recording, replay) -> None:
    """Events that come from outside are no outcomes, whenever they come."""
    told = list(recording.until(events.RecordTaken, count=2))
    told.insert(-1, events.SetInvalidated(at=SetKey(phase=Phase.AFTER, point=9), reason="a visitor"))
    report = replay(told)
    assert report.differences == []
    assert report.taken == 2


def test_decisions_do_not_depend_on_time_or_random_numbers(recording, replay, monkeypatch) -> None:
    hours = itertools.count(0, -977)
    monkeypatch.setattr(time, "time", lambda: 3600.0 * next(hours))
    monkeypatch.setattr(random, "random", lambda: pytest.fail("chance"))
    np.random.seed(next(hours) % 1000)  # noqa: NPY002 - the one that everybody shares is meant
    assert replay(recording.history[:30], scope=Scope.DECISIONS).differences == []


def test_an_error_of_the_program_is_reproduced(recording, replay, monkeypatch) -> None:
    """For bug reports: what broke the run breaks its replay."""

    def broken(*_: object) -> None:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr("procedures.steps.identify.identify", broken)
    history = [*recording.until(events.Identified)[:-1]]
    stopped_by_it = events.Interrupted(reason="by nothing", exit_code=1)
    assert replay([*history, stopped_by_it], scope=Scope.RESULTS).differences == []
    [difference] = replay(recording.until(events.Identified), scope=Scope.IDENTIFICATION).differences
    assert difference.change.replayed == "failed: ZeroDivisionError('by nothing')"
