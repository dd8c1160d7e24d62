"""Each result is given once, and nothing is read while nothing changes."""

import pytest

from hexacell.result_server import published_result as new_results
from hexacell.result_server.published_result import NewResults, ResultEvaluation, ResultState
from hexacell.runs.run_folder import runs_folder
from hexacell.services.history.past_runs import past_runs
from hexacell.verdict.decision import Verdict
from tests.hexacell.services.proposed_runs import a_cell, propose_run


@pytest.fixture
def cell(tmp_path):
    return a_cell(tmp_path)


def test_each_is_given_once_and_runs_are_read_only_after_a_change(cell, monkeypatch) -> None:
    read: list[int] = []

    def counted(of):
        read.append(1)
        return past_runs(of)

    monkeypatch.setattr(new_results, "past_runs", counted)
    results = NewResults(cell, pytest.fail)
    assert results.fetch() == []
    for day, verdict in ((1, Verdict.PASS), (2, Verdict.FAIL)):
        propose_run(cell, f"2026-11-0{day}T100000Z", verdict=verdict)
    first, second = results.fetch()
    assert (first.evaluation, second.evaluation) == (ResultEvaluation.OK, ResultEvaluation.NOT_OK)
    assert first.result_id < second.result_id
    count = len(read)
    assert [results.fetch() for _ in range(3)] == [[], [], []]
    assert len(read) == count
    propose_run(cell, "2026-11-03T100000Z", verdict=None)
    (third,) = results.fetch()
    assert (third.evaluation, third.state) == (ResultEvaluation.UNDEFINED, ResultState.ABORTED)


def test_what_cannot_be_read_is_told_once(cell) -> None:
    runs_folder(cell).parent.mkdir()
    runs_folder(cell).write_text("no folder")
    warnings: list[str] = []
    results = NewResults(cell, warnings.append)
    assert [results.fetch() for _ in range(3)] == [[], [], []]
    assert len(warnings) == 1
    runs_folder(cell).unlink()
    propose_run(cell, "2026-11-01T100000Z")
    assert len(results.fetch()) == 1
