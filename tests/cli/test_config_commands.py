"""``apply`` and ``rollback`` as they are typed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from hexacell.cell.loader import load_cell
from hexacell.robot.model import config_layout
from hexacell.verdict.acceptance_gates import AcceptanceGate
from tests.cli.terminal import ended
from tests.hexacell.config.test_keyed_formats import write_hal, write_ini
from tests.hexacell.services.proposed_runs import MET, propose_run

GRAVE = AcceptanceGate(
    name="within tolerance", passed=False, sentence="Beyond: S1x.", needs_person=True, needs_cell_name=True
)
KEYS_APPLIED = {"applied", "by", "config", "further_configs", "run", "sha256", "teach", "recorded"}
KEYS_RESTORED = {"restored", "config", "further_configs", "from", "undone", "recorded"}


@dataclass(frozen=True)
class OtherFormat:
    """A format beside the native one: its options in the cell file, and how a config of it is written."""

    options: str
    rows: Callable[[Callable[[str], str], str], list[str]]


SIGNS = "[-1, -1, -1, 1, 1, 1]"
LINES = '["JOINT[{leg}] := ({S.x}, {S.y}, {S.z});", "BALL[{leg}] := ({B.x}, {B.y}, {B.z}), {l};"]'


def write_lines(number: Callable[[str], str], gap: str) -> list[str]:
    """Those of a controller that is not known."""
    rows = [";PARAMETERS"]
    for leg in range(1, 7):
        joint, ball = (gap.join(f"{number(f'{kind}{leg}{axis}')}," for axis in "xyz") for kind in "SB")
        rows.append(f"JOINT[{leg}] := ({joint.rstrip(',')});")
        rows.append(f"BALL[{leg}] := ({ball.rstrip(',')}), {number(f'l{leg}')};")
    return rows


FORMATS = {
    "linuxcnc-ini": OtherFormat(f'{{ section = "HEXAGLIDE", branch = {SIGNS} }}', write_ini),
    "linuxcnc-hal": OtherFormat(f'{{ component = "hexaglidekins", branch = {SIGNS} }}', write_hal),
    "template": OtherFormat(f"{{ branch = {SIGNS}, lines = {LINES} }}", write_lines),
}


@pytest.fixture(params=["toml", *FORMATS])
def cell(cell_folder, request):
    """A cell whose controller has a config of each format."""
    native = load_cell(cell_folder.cell)
    if request.param == "toml":
        return native
    found = FORMATS[request.param]
    geometry = config_layout(native.settings).read(native.config_path).geometry
    numbers = dict(zip(geometry.parameters.names, geometry.vector.tolist(), strict=True))
    native.config_path.write_text("\n".join([*found.rows(lambda name: repr(numbers[name]), " "), ""]))
    text = native.path.read_text()
    assert text.count('config_format = "toml"') == 1
    stated = f'config_format = "{request.param}"\nconfig_options = {found.options}'
    native.path.write_text(text.replace('config_format = "toml"', stated))
    return load_cell(native.path)


def test_applied_and_undone(cell, typed_here) -> None:
    run = propose_run(cell)
    applied = typed_here("apply", run.folder.path)
    assert (applied.code, cell.config_path.read_bytes()) == (0, run.after)
    assert "approved by the command" in applied.out
    assert "Restart or reload the controller before it moves" in applied.out
    again = typed_here("apply", run.folder.path)
    assert (again.code, "nothing was written" in again.out) == (0, True)
    undone = typed_here("rollback", cell.path)
    assert (undone.code, cell.config_path.read_bytes()) == (0, run.before)
    assert "bit for bit, which undoes the run 2026-11-20T100000Z" in undone.out
    restored = typed_here("rollback", cell.path, "--to", run.folder.path.name)
    assert (restored.code, cell.config_path.read_bytes()) == (0, run.after)


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


@pytest.mark.sample("linuxcnc-ini")
def test_unattended_what_needs_a_person_is_refused(cell, typed) -> None:
    run = propose_run(cell, gates=(MET, GRAVE))
    refused = typed("apply", run.folder.path)
    assert (refused.code, cell.config_path.read_bytes()) == (4, run.before)
    assert "Beyond: S1x." in refused.err


@pytest.mark.sample("toml")
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
