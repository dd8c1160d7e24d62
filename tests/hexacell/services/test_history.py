"""The runs of a cell so far: what became of each, the newest first, whatever some folders hold."""

import numpy as np
import pytest

from hexacell.cell.loader import Cell
from hexacell.config.write_back import commit
from hexacell.errors import UsageError
from hexacell.services.history.past_runs import compare_runs, parameter_trends, past_runs
from hexacell.services.write_back.config_rollback import roll_back_config
from hexacell.text.history import NO_DRIFT, NO_RUNS, comparison_text, drift_text, history_text, standing
from hexacell.verdict.decision import Verdict
from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.hexacell.results.test_run_comparison import covariance, result
from tests.hexacell.services.proposed_runs import ProposedRun, propose_run
from tests.recorded_events import record


def identified(cell: Cell, name: str, shift_mm: float = 0.0) -> ProposedRun:
    """A run with a result, of which all values of legs 1 are shifted."""
    run = propose_run(cell, name)
    history = list(read_journal(run.folder.journal))
    values = np.full(42, 100.0)
    values[-6] += shift_mm
    run.folder.journal.unlink()
    found = events.Identified(result=result(values), held_out=())
    record(run.folder.journal, [history[0], found, *history[1:]])
    return run


def test_a_cell_without_runs_has_no_history(cell) -> None:
    assert past_runs(cell) == ()
    assert history_text(()) == NO_RUNS
    assert drift_text(parameter_trends(cell, ())) == NO_DRIFT


def test_what_became_of_each_run_is_told(cell) -> None:
    first = propose_run(cell, "a")
    commit(first.change, first.folder.path)
    second = propose_run(cell, "b", verdict=Verdict.CONDITIONAL_PASS)
    third = propose_run(cell, "c")
    commit(third.change, third.folder.path)
    runs = past_runs(cell)
    assert [run.name for run in runs] == ["c", "b", "a"]
    assert [run.summary.verdict for run in runs] == [Verdict.PASS, Verdict.CONDITIONAL_PASS, Verdict.PASS]
    assert [run.is_in_controller for run in runs] == [True, False, False]
    assert runs[1].folder == second.folder
    assert standing(runs[1]) == "proposal"
    roll_back_config(cell)
    assert [run.is_in_controller for run in past_runs(cell)] == [False, False, True]


def test_a_run_that_is_not_over_says_so(cell) -> None:
    run = propose_run(cell)
    history = read_journal(run.folder.journal)
    run.folder.journal.unlink()
    record(run.folder.journal, (*history[:-1], events.Interrupted(reason="a cable broke", exit_code=3)))
    (found,) = past_runs(cell)
    assert not found.summary.is_over
    assert (found.summary.line, standing(found)) == ("not over: a cable broke", "proposal")
    run.folder.proposal.unlink()
    (found,) = past_runs(cell)
    assert standing(found) == "not over"


def test_what_cannot_be_read_is_listed_last_with_its_reason(cell) -> None:
    propose_run(cell, "a")
    damaged = propose_run(cell, "z")
    damaged.folder.journal.write_bytes(b"rubbish\nrubbish\n")
    (damaged.folder.path.parent / "empty").mkdir()
    (damaged.folder.path.parent / "note.txt").write_text("not a run")
    runs = past_runs(cell)
    assert [(run.name, standing(run)) for run in runs[1:]] == [("z", "unreadable"), ("empty", "unreadable")]
    assert "damaged" in runs[1].summary.line
    assert max(map(len, history_text(runs).splitlines())) <= 80


def test_two_runs_are_compared(cell) -> None:
    identified(cell, "a")
    identified(cell, "b", shift_mm=1.0)
    before, after, compared = compare_runs(cell, "a", "b")
    assert (before.name, after.name, compared.is_changed) == ("a", "b", True)
    assert [one.name for one in compared.significant] == ["l1"]
    sigma = np.sqrt(2.0 * covariance()[-6, -6])
    text = comparison_text(before, after, compared)
    assert f"most of all l1, by +1.000 mm (sigma {sigma:.3f})." in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 80
    _, _, same = compare_runs(cell, "a", "a")
    assert "nothing changed by more than the noise" in comparison_text(before, before, same)


def test_a_run_without_a_result_is_not_compared(cell) -> None:
    identified(cell, "a")
    propose_run(cell, "b")
    with pytest.raises(UsageError, match="the run b identified no geometry"):
        compare_runs(cell, "a", "b")
    with pytest.raises(UsageError, match="there is no run 'c'"):
        compare_runs(cell, "a", "c")
