"""Going on with a killed run as its user would, and checks of what is promised of it then."""

import csv
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hexacell.measurements.csv_file import read_measurements
from hexacell.runs.run_folder import RunFolder
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from tests.faults.cell import HELD_OUT_ORIENTATIONS, ORIENTATIONS, POINTS, Site
from tests.faults.steps import step_of

HOW_IT_CAME = ["time_s", *(f"d{joint}" for joint in range(1, 7))]


def whole_lines(journal: bytes) -> bytes:
    """A journal without a torn end."""
    return journal[: journal.rfind(b"\n") + 1]


def require_valid(run: RunFolder) -> RunState:
    """Every planned record counts exactly once, and all files say the same."""
    history = read_journal(run.journal)
    state = fold(history)
    assert state.ended is not None
    labels = Counter((record.point, record.orientation) for record in state.measurements().records)
    planned = [(p, o) for p in range(1, len(POINTS) + 1) for o in range(1, ORIENTATIONS + 1)]
    assert labels == Counter(planned)
    for phase in (Phase.BEFORE, Phase.AFTER):
        held_out = Counter((sample.at.point, sample.orientation) for sample in state.samples(phase))
        assert set(held_out.values()) == {1}
        more = HELD_OUT_ORIENTATIONS - 1 if phase is Phase.AFTER else 0
        assert len(held_out) == 2 * (HELD_OUT_ORIENTATIONS + more)
    assert all(measured.closed for measured in state.sets.values())
    require_one_go(history, state)
    assert read_measurements(run.measurements) == state.measurements()
    assert state.identified is not None
    result = json.loads(run.result.read_text())
    identified = state.identified.result.model_dump(mode="json")
    assert {key: result[key] for key in identified} == identified
    return state


def require_one_go(history: Sequence[events.Event], state: RunState) -> None:
    """No record is counted that was measured against a zero, or under a geometry, that is gone."""
    for key in state.sets:
        ends = [n for n, event in enumerate(history) if _ends(event, key)]
        attempt = history[max(ends, default=0) :]
        counted = [e for e in attempt if isinstance(e, events.RecordTaken) and e.at == key]
        assert tuple(counted) == state.sets[key].samples


def _ends(event: events.Event, key: SetKey) -> bool:
    """Whether an attempt at a set ends here."""
    match event:
        case events.SetInvalidated():
            return event.at == key
        case events.Committed():
            return key.phase is Phase.AFTER
    return False


def require_identical(site: Site, undisturbed: Site) -> None:
    """Without noise, an interrupted run ends as one that nothing disturbed, to the last digit.

    But later, and it may come to a pose by another way: then joints arrive from other sides, and what that
    says of backlash is another number.
    """
    run, reference = site.run(), undisturbed.run()
    assert (run.path / "config-before").read_bytes() == (reference.path / "config-before").read_bytes()
    assert _as_measured(run.measurements) == _as_measured(reference.measurements)
    assert _without_evidence(run.result) == _without_evidence(reference.result)
    assert site.config.read_bytes() == undisturbed.config.read_bytes()


def _as_measured(measurements: Path) -> list[dict[str, str]]:
    with measurements.open(newline="") as stream:
        return [
            {name: text for name, text in row.items() if name not in HOW_IT_CAME}
            for row in csv.DictReader(stream)
        ]


def _without_evidence(result: Path) -> dict[str, object]:
    document = json.loads(result.read_text())
    for term in document["terms"]:
        del term["log_factor"]
    return dict(document)


def require_tidy(site: Site) -> None:
    """Nothing that was half written lies about."""
    assert not site.strangers()
    assert not site.beside_the_config()


KILLED = -9


def history_of(site: Site) -> Sequence[events.Event]:
    """What the latest run's journal says; a torn end says nothing."""
    return read_journal(site.runs()[-1].journal) if site.runs() else ()


def finish(program: Any, site: Site, *, code: int = 0) -> None:
    """Do what the user of a killed run does: resume it, or begin anew where nothing was begun."""
    at_the_kill = {run.journal: run.journal.read_bytes() for run in site.runs()}
    begun = bool(history_of(site))
    ended = program.resume(site) if site.runs() else program.run(site)
    if site.runs() and not begun and at_the_kill:
        assert (ended.code, "Begin a new run" in ended.words) == (2, True), ended.words
        [empty] = site.runs()
        empty.journal.unlink()
        ended = program.run(site)
    for journal, content in at_the_kill.items():
        assert not whole_lines(content) or journal.read_bytes().startswith(whole_lines(content))
    over = "is over" in ended.words
    assert ended.code == (2 if over else code), ended.words
    require_valid(site.run())
    require_tidy(site)


def places(history: Sequence[events.Event]) -> dict[str, int]:
    """How many records a run has when each kind of step begins for the first time."""
    first: dict[str, int] = {}
    for number, event in enumerate(history, start=1):
        if isinstance(event, events.StepBegun):
            first.setdefault(step_of(history[:number]), number)
    return first


def after(records: int) -> dict[str, int]:
    return {"die_after_records": records}


def within(record: int) -> dict[str, int]:
    return {"tear_record": record}
