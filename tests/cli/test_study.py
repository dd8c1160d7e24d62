"""``hexacell study``: from the command to the table, the picture and what is kept."""

import json
import signal
from pathlib import Path

import pytest

from hexacell.errors import ExitCode

PAPER = ("study", "paper", "--draws", "1", "--processes", "2", "--folder", "kept")


def results(folder: Path) -> list[str]:
    return (folder / "kept" / "paper.jsonl").read_text().splitlines()


@pytest.mark.slow
def test_the_paper_is_repeated_and_what_is_known_is_not_computed_again(typed, tmp_path: Path) -> None:
    first = typed(*PAPER)
    assert first.code == 0, first.err
    assert "Figure 4: largest error of a parameter" in first.out
    assert max(map(len, first.out.splitlines())) <= 80
    assert (tmp_path / "kept" / "paper.svg").read_text().startswith("<svg ")
    kept = results(tmp_path)
    assert len(kept) == len({json.loads(line)["key"] for line in kept}) == 10
    again = typed(*PAPER, "--json")
    assert results(tmp_path) == kept
    told = json.loads(again.out)
    assert [one["points"] for one in told["figures"]["4"]] == [1, 2, 3, 4, 5]
    assert told["figures"]["4"][0]["noisy"]["refused"] == 1


@pytest.mark.slow
def test_an_interrupted_study_goes_on_where_it_was(start, typed, tmp_path: Path) -> None:
    """Also after a power cut in the middle of a line."""
    process = start(*PAPER)
    path = tmp_path / "kept" / "paper.jsonl"
    process.wait_until(lambda: path.exists() and path.read_text().count("\n") >= 3, "results")
    ended = process.stopped(signal.SIGINT)
    assert ended.code == ExitCode.INTERRUPTED
    assert "Traceback" not in ended.err
    kept = results(tmp_path)
    with path.open("a") as file:
        file.write('{"key":"5 x 11')
    process = start(*PAPER)
    process.wait_until(lambda: path.read_text().count("\n") > len(kept), "more results")
    process.stopped(signal.SIGINT)
    assert results(tmp_path)[: len(kept)] == kept
    assert all(json.loads(line)["outcome"] for line in results(tmp_path))


def test_what_is_no_study_is_not_overwritten(typed_here, tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "paper.jsonl").write_text("mine\n")
    refused = typed_here(*PAPER)
    assert refused.code == ExitCode.USAGE
    assert "paper.jsonl:1: this is not a result of this study. Name another folder" in refused.err
    assert (tmp_path / "kept" / "paper.jsonl").read_text() == "mine\n"


def test_a_number_of_draws_is_above_zero(typed_here) -> None:
    refused = typed_here("study", "paper", "--draws", "0")
    assert (refused.code, "--draws" in refused.err) == (ExitCode.USAGE, True)
