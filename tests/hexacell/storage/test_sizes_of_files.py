"""The size of a file is looked at before it is read, and every file that is read goes through one place."""

import ast
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drivers.encoders.node_identity import read_data_sheet
from hexacell.cell.loader import load_cell
from hexacell.config.change import ConfigChange
from hexacell.config.layout import read_contents
from hexacell.config.write_record import read_records
from hexacell.errors import FileError
from hexacell.measurements.csv_file import read_measurements
from hexacell.storage import atomic_files
from procedures.journal.journal import Journal, read_journal

ROOT = Path(__file__).parents[3]
READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "cell": ("cell.toml", load_cell),
    "config": ("controller.toml", lambda path: read_contents([path])),
    "measurements": ("a.csv", read_measurements),
    "journal": ("journal.jsonl", read_journal),
    "journal to append to": ("journal.jsonl", Journal),
    "proposal": ("proposal.json", ConfigChange.load),
    "history of the config": ("config-writes.jsonl", lambda path: read_records(path.parent)),
    "data sheet": ("a.eds", read_data_sheet),
}


@pytest.mark.parametrize("reader", READERS)
def test_a_file_that_is_too_large_is_refused_unread(tmp_path: Path, reader: str) -> None:
    name, read = READERS[reader]
    path = tmp_path / name
    path.touch()
    os.truncate(path, atomic_files.LARGEST_BYTES + 1)  # a hole, which takes no room
    with pytest.raises(
        FileError, match=r"is too large: 200\.0 MB, and at most [\d.]+ MB are read"
    ) as refusal:
        read(path)
    assert refusal.value.subject == str(path)


def test_a_file_that_grows_while_it_is_read_is_refused(tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "growing"
    path.write_bytes(b"12345")
    monkeypatch.setattr(atomic_files, "require_size", lambda *_: path.write_bytes(b"1234567"))
    with pytest.raises(FileError, match="is too large"):
        atomic_files.read_bytes(path, 6)


ELSEWHERE = {
    "hexacell/storage/atomic_files.py": "the one place",
    "procedures/journal/journal.py": "looks at the size itself, and reads line by line",
    "hexacell/services/run/event_stream.py": "copies a journal in pieces",
    "hexacell/services/history/recorded_cell.py": "reads one line of a journal, of bounded length",
    "hexacell/services/preflight.py": "a table of the kernel's",
    "hexacell/config/write_record.py": "appends",
    "hexacell/study/tasks.py": "appends",
    "hexacell/runs/cell_lock.py": "reads a bounded note, and tables of the kernel's",
    "hexacell/runs/archive.py": "creates a database",
    "hexacell/storage/opcua_certificate.py": "writes a new key",
    "drivers/controllers/linuxcnc/module_program.py": "a table of the kernel's",
    "hexacell/services/unattended/outbox.py": "a folder",
    "hexacell/run_process/run_socket.py": "a folder",
    "hexacell/cli/process.py": "writes a report",
    "hexacell/cli/console.py": "the null device",
    "hexacell/cli/commands/host.py": "the null device",
    "drivers/thermometers.py": "reads a bounded number of bytes",
    "drivers/discovery/encoders.py": "a number of the kernel's",
    "drivers/controllers/linuxcnc/restart.py": "the kernel's list of a process; the end of a log",
    "hexacell/storage/output_files.py": "reads the first and the last bytes",
    "hexacell/services/unattended/scheduled_run.py": "the zone of the computer",
    "drivers/encoders/dbc.py": "looks at the size before a library reads",
}

WHOLE = {"read_text", "read_bytes", "readlines", "load_file", "import_od", "loadtxt", "fromfile"}
LOADERS = {"json", "tomllib", "pickle", "np", "os"}
MODES = {"r", "rb", "w", "wb", "a", "ab", "xb", "r+b"}


def opens(node: ast.AST) -> bool:
    """Whether something of a file is opened there, or read as a whole."""
    match node:
        case ast.Call(func=ast.Name(id="open")):
            return True
        case ast.Call(func=ast.Attribute(value=of, attr=name), args=arguments):
            receiver = of.id if isinstance(of, ast.Name) else ""
            has_mode = any(isinstance(one, ast.Constant) and one.value in MODES for one in arguments)
            is_loaded = receiver in LOADERS and name in {"load", "open", "fdopen"}
            return receiver != "atomic_files" and (
                name in WHOLE or is_loaded or (name == "open" and has_mode)
            )
    return False


def test_every_other_place_that_opens_a_file_has_a_reason() -> None:
    found = {
        str(path.relative_to(ROOT))
        for package in ("hexacell", "drivers", "procedures")
        for path in (ROOT / package).rglob("*.py")
        if any(map(opens, ast.walk(ast.parse(path.read_text(encoding="utf-8")))))
    }
    assert found - set(ELSEWHERE) == set(), (
        "use hexacell.storage.atomic_files, which looks at the size first"
    )
    assert set(ELSEWHERE) - found == set(), "there is nothing to excuse"
