"""``apply`` and ``rollback`` as they are typed."""

import pytest

from tests.cli.terminal import ended
from tests.hexacell.services.proposed_runs import GRAVE, MET, propose_run

pytestmark = pytest.mark.usefixtures("records_agree")

KEYS_APPLIED = {"applied", "by", "config", "further_configs", "run", "sha256", "teach", "recorded"}
KEYS_RESTORED = {"restored", "config", "further_configs", "from", "undone", "recorded"}


def test_programs_get_one_document(cell, typed_here) -> None:
    run = propose_run(cell)
    applied = typed_here("apply", run.folder.path, "--json").document
    assert set(applied) == KEYS_APPLIED
    assert (applied["applied"], applied["by"]) == (True, "the command")
    restored = typed_here("rollback", cell.path, "--json").document
    assert set(restored) == KEYS_RESTORED
    assert restored["restored"] is True
    nothing = typed_here("rollback", cell.path, "--json")
    assert (nothing.code, nothing.document["exit_code"]) == (2, 2)


def test_an_edit_is_refused_politely(cell, typed_here) -> None:
    run = propose_run(cell)
    edited = run.before + b"# a note\n"
    cell.config_path.write_bytes(edited)
    refused = typed_here("apply", run.folder.path)
    assert (refused.code, cell.config_path.read_bytes()) == (2, edited)
    assert "The edit since it was before the run:" in refused.err
    assert "+# a note" in refused.err
    assert refused.err.splitlines()[-1].endswith("undo the edit and repeat, or calibrate again")


def test_what_is_grave_needs_the_cells_name(cell, start, terminal) -> None:
    run = propose_run(cell, gates=(MET, GRAVE))
    process = start("apply", run.folder.path, stdin=terminal.slave, stderr=terminal.slave)
    terminal.read_until("Type the cell's name, simulated-hexaglide, to take the responsibility, or no: ")
    terminal.type("yes\n")
    terminal.read_until("Type the cell's name")
    terminal.type("simulated-hexaglide\n")
    assert ended(process, terminal) == 0
    assert cell.config_path.read_bytes() == run.after
    assert "approved by a person at the terminal" in process.out
