"""``hexacell replay``: its output and exit codes."""

from dataclasses import replace

import pytest

from hexacell.verdict.decision import Verdict
from procedures.journal.journal import encode, read_entries
from procedures.steps import events


@pytest.mark.slow
def test_a_manipulated_journal_is_different_and_the_record_is_named(typed_here, demo, tmp_path):
    """Another verdict and other words, all checksums right."""
    entries = list(read_entries(demo.run / "journal.jsonl"))
    for place, entry in enumerate(entries):
        if isinstance(entry.event, events.ResultValidated):
            judged = entry.event.model_copy(update={"verdict": Verdict.FAIL, "line": "Not at all."})
            entries[place] = replace(entry, event=judged)
            line = entry.number
    path = tmp_path / "journal.jsonl"
    path.write_bytes(b"".join(map(encode, entries)))
    outcome = typed_here("replay", path, "--only", "results", "--json")
    assert outcome.code == 1
    first, *others, verdict = outcome.err.splitlines()
    assert first == f"NO  line {line}, judge: verdict: recorded fail, replayed pass"
    assert others[0].startswith(f"--  line {line}, judge: line: recorded Not at all., replayed ")
    assert verdict.endswith(f": different, first in line {line} (judge)")
    assert max(map(len, outcome.err.splitlines())) <= 80
    assert outcome.document["same"] is False
    assert [one["counts"] for one in outcome.document["differences"]][:2] == [True, False]
    alone = typed_here("replay", path, "--only", "identification")
    assert (alone.code, alone.out.startswith("0 decisions and 1 results of ")) == (0, True)


def test_an_unreadable_journal_is_reported(typed_here, demo, tmp_path):
    outcome = typed_here("replay", tmp_path / "nowhere")
    assert outcome.code == 2
    assert "nowhere: cannot be read: it does not exist" in outcome.err
    damaged = (demo.run / "journal.jsonl").read_bytes().replace(b'"begun"', b'"began"', 1)
    (tmp_path / "journal.jsonl").write_bytes(damaged)
    outcome = typed_here("replay", tmp_path)
    assert outcome.code == 2
    assert "journal.jsonl:2: this line of the journal is damaged" in outcome.err
    outcome = typed_here("replay", tmp_path, "--tolerance", "nan")
    assert outcome.code == 2
    assert "--tolerance nan is not a tolerance" in outcome.err
