"""``hexacell history`` as it is typed."""

import json

import pytest

from hexacell.config.write_back import commit
from hexacell.config.write_record import RECORDS
from hexacell.runs.run_folder import find_run
from tests.hexacell.services.proposed_runs import propose_run
from tests.hexacell.services.recorded_nights import Nights
from tests.hexacell.services.test_history import identified

pytestmark = pytest.mark.usefixtures("records_agree")

KEYS = {
    "run", "began", "ended", "mode", "records", "verdict", "position_mm", "expanded_mm", "limit_mm", "line",
    "begun", "over", "in_controller", "written", "proposal",
}  # fmt: skip


def test_the_runs_are_listed(cell, typed_here) -> None:
    run = propose_run(cell)
    commit(run.change, run.folder.path)
    listed = typed_here("history", cell.path)
    assert listed.code == 0
    assert [line.split()[:3] for line in listed.out.splitlines()] == [
        ["run", "mode", "verdict"],
        ["2026-11-20T100000Z", "optimise", "pass"],
    ]
    (document,) = typed_here("history", cell.path, "--json").document["runs"]
    assert set(document) == KEYS
    assert (document["run"], document["in_controller"]) == (str(run.folder.path), True)


def test_two_runs_and_the_drift(cell, typed_here) -> None:
    for name in "abc":
        identified(cell, name, shift_mm=0.0)
    compared = typed_here("history", cell.path, "--compare", "a", "b")
    assert (compared.code, compared.out.startswith("a -> b: nothing changed")) == (0, True)
    document = typed_here("history", cell.path, "--compare", "a", "b", "--json").document
    assert (document["changed"], document["frame"], len(document["parameters"])) == (False, "paper", 35)
    assert set(document["parameters"][0]) == {
        "name", "unit", "before", "after", "sigma", "change", "significant",
    }  # fmt: skip
    drift = typed_here("history", cell.path, "--drift", "--json").document
    assert len(drift["parameters"]) == 35
    json.dumps(drift, allow_nan=False)
    assert typed_here("history", cell.path, "--drift").out.startswith("No parameter drifts.")


def test_a_run_is_told_in_lines(cell, typed_here) -> None:
    identified(cell, "a")
    told = typed_here("history", cell.path, "--show", "a")
    assert told.code == 0
    lines = told.out.splitlines()
    assert lines[0][8:] == "  optimise of simulated-hexaglide, hexacell 0"
    assert any(line.endswith("the old geometry is back in the controller") for line in lines)
    assert any(line.endswith("  over") for line in lines)
    assert "It took " in told.out
    assert " lets expect " in " ".join(lines[-3:])
    document = typed_here("history", cell.path, "--show", "a", "--json").document
    assert {"moving", "settling", "reading", "deciding", "asking", "placing gauges"} == set(
        document["seconds"]
    )
    events = document["events"]
    recorded = find_run(cell, "a").cell_file
    recorded.write_text(recorded.read_text().replace("[timing]", "[timing]\nof_an_older_program = 1"))
    older = typed_here("history", cell.path, "--show", "a")
    assert (older.code, "It took " in older.out) == (0, False)
    assert [events[0]["kind"], events[-1]["kind"]] == ["started", "ended"]
    assert events[-1]["text"] == "over"
    assert typed_here("history", cell.path, "--show", "never").code == 2


def test_an_archive_that_cannot_be_used(cell, typed_here, tmp_path) -> None:
    propose_run(cell)
    listed = typed_here("history", cell.path, "--archive", f"postgresql://nobody@/none?host={tmp_path}")
    assert (listed.code, len(listed.out.splitlines())) == (0, 2)
    assert listed.err.count("warning") == 1
    assert "read from their folders" in listed.err
    for url in ("postgresql://me:secret@host/cells", "postgresql://me@host/cells?password=secret"):
        refused = typed_here("history", cell.path, "--archive", url)
        assert (refused.code, "secret" in refused.err, ".pgpass" in refused.err) == (2, False, True)
    assert typed_here("history", cell.path, "--archive", "sqlite:///x").code == 2


def test_a_leg_that_moved_is_told_with_the_night(cell, typed_here) -> None:
    nights = Nights(cell)
    nights.calibrate()
    for _ in range(4):
        nights.check()
    nights.changes = {"l4": 0.31}
    nights.check()
    told = typed_here("history", cell.path, "--drift")
    assert (told.code, told.out.startswith("leg 4 moved 0.3")) == (0, True)
    document = typed_here("history", cell.path, "--drift", "--json").document
    assert set(document) == {"parameters", "runs", "temperatures_c", "changes", "shares_of_limit"}
    (change,) = document["changes"]
    assert set(change) == {
        "leg", "possible_legs", "after", "before", "noticed", "or_parameters",
        "parameter", "unit", "change", "sigma", "other_legs", "moved_again", "last_noticed",
    }  # fmt: skip
    assert (change["leg"], change["before"]) == (4, "2026-03-06T02:30:00+00:00")
    json.dumps(document, allow_nan=False)


def test_old_runs_are_listed_and_deleted_if_asked_for(cell, typed_here) -> None:
    nights = Nights(cell)
    folder = nights.check()
    listed = typed_here("history", cell.path, "--keep", "30")
    assert (listed.code, folder.path.name in listed.out, folder.path.exists()) == (0, True, True)
    document = typed_here("history", cell.path, "--keep", "30", "--delete", "--json").document
    assert (document["deleted"], document["runs"], document["kept"]) == (True, [str(folder.path)], [])
    assert not folder.path.exists()
    for wrong in (("--delete",), ("--keep", "-1"), ("--keep", "nan")):
        assert typed_here("history", cell.path, *wrong).code == 2


def test_every_write_into_the_config_is_listed(cell, typed_here) -> None:
    assert typed_here("history", cell.path, "--changes").out == "No run of this cell wrote its config.\n"
    run = propose_run(cell)
    assert typed_here("apply", run.folder.path, "--reason", "new fixture").code == 0
    assert typed_here("rollback", cell.path).code == 0
    listed = typed_here("history", cell.path, "--changes")
    heads = [line[21:] for line in listed.out.splitlines() if not line.startswith(" ")]
    assert heads == ["rolled back", "the proposal of 2026-11-20T100000Z applied"]
    assert all(len(line) <= 80 for line in listed.out.splitlines())
    assert '  given as the reason: "new fixture"' in listed.out
    document = typed_here("history", cell.path, "--changes", "--json").document
    assert set(document) == {"changes", "damaged_lines"}
    back, applied = document["changes"]
    assert set(applied) == {
        "at", "kind", "by", "user", "host", "run", "config", "further_configs", "sha256_before",
        "sha256_after", "numbers_changed", "largest", "verdict", "why", "reason", "recorded",
    }  # fmt: skip
    assert (back["kind"], applied["kind"], applied["reason"]) == ("rolled back", "applied", "new fixture")
    assert set(applied["largest"]) == {"name", "change", "unit"}
    refused = typed_here("rollback", cell.path, "--reason", "two\nlines")
    assert (refused.code, "one line" in refused.err) == (2, True)


def test_a_damaged_record_is_warned_about(cell, typed_here) -> None:
    run = propose_run(cell)
    typed_here("apply", run.folder.path)
    with (run.folder.siblings / RECORDS).open("ab") as stream:
        stream.write(b'{"version":1,"at":"2026')
    listed = typed_here("history", cell.path, "--changes")
    assert (listed.code, "applied" in listed.out) == (0, True)
    assert "line 2: this record is torn" in listed.err
