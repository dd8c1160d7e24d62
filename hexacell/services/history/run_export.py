"""A copy of a run folder that may be given to others: the same run, its passwords masked.

Journals of earlier versions have the whole cell file, with passwords that stood in it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hexacell.config.change import ConfigChange
from hexacell.config.layout import fingerprint_of
from hexacell.config.receipt import AFTER, BEFORE, RECEIPT
from hexacell.errors import FileError, UsageError
from hexacell.runs.run_folder import CELL_FILE, MEASUREMENTS, RESULT, RunFolder
from hexacell.storage import atomic_files
from hexacell.storage.secrets import MASK, clear_secrets, with_lines_masked, without_secrets
from hexacell.storage.toml_document import TomlDocument
from procedures.engine.config_edits import PROVISIONAL_FOLDER
from procedures.journal.journal import read_entries
from procedures.journal.line_format import with_event
from procedures.run.events import RunStarted

_CONFIG = re.compile(f"({BEFORE}|{AFTER})(-[0-9]+)?")
"""A file of a config, as it was or as it was written."""

_AS_THEY_ARE = (MEASUREMENTS, RESULT, RECEIPT, f"{PROVISIONAL_FOLDER}/{RECEIPT}")
_WIRE_LINE = re.compile(r"(?P<head>\S+ .+ [<>] )(?P<bytes>[0-9a-f]{2}(?: [0-9a-f]{2})*)  .*")
_HALF_MASKED = re.compile(rb"\*\*\*[^\s]+")


def export_run(run: Path, target: Path) -> tuple[str, ...]:
    """Copy a run folder to ``target`` without its secrets; gives the names of the files in it.

    Only files that belong to a run are copied. The copy can be replayed.

    Raises:
        UsageError: ``target`` is not empty.
        FileError: there is no run, its journal is damaged, or the copy cannot be written.
    """
    folder = RunFolder(run)
    entries = read_entries(folder.journal)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise UsageError("something is there already", subject=target, action="Name a new folder")
    started = entries[0].event if entries else None
    cell_text = started.cell_text if isinstance(started, RunStarted) else ""
    names = []
    for name, data in _files(folder, cell_text):
        atomic_files.create_folder_durably((target / name).parent)
        atomic_files.write_atomically(target / name, data)
        names.append(name)
    return tuple(names)


def _files(folder: RunFolder, cell_text: str) -> Iterator[tuple[str, bytes]]:
    """The files of the copy: name and content."""
    yield folder.journal.name, _journal(folder.journal, cell_text)
    if (text := _kept(folder, CELL_FILE)) is not None:
        yield CELL_FILE, _text(text)
    for name in _configs(folder.path):
        if (text := _kept(folder, name)) is not None:
            yield name, _text(text)
    for name in _AS_THEY_ARE:
        if (data := _kept(folder, name)) is not None:
            yield name, data
    if _kept(folder, folder.proposal.name) is not None:
        yield folder.proposal.name, _proposal(folder.proposal)
    passwords = _passwords_in(cell_text)
    for path in sorted(folder.path.glob(f"{folder.wire.name}*")):
        if (data := _kept(folder, path.name)) is not None:
            yield path.name, _wire(data, passwords)


def _configs(folder: Path) -> Iterator[str]:
    """The names of the versions of the config that a run keeps."""
    for one in (folder, folder / PROVISIONAL_FOLDER):
        for path in sorted(one.iterdir()) if one.is_dir() else ():
            if _CONFIG.fullmatch(path.name):
                yield str(path.relative_to(folder))


def _kept(folder: RunFolder, name: str) -> bytes | None:
    """A file of the run; links are not followed, as they may lead anywhere."""
    path = folder.path / name
    return None if path.is_symlink() or path.parent.is_symlink() else atomic_files.read_if_present(path)


def _journal(path: Path, cell_text: str) -> bytes:
    first, *others = atomic_files.read_bytes(path).splitlines(keepends=True) or [b""]
    if not cell_text:
        return first + b"".join(others)

    def masked(event: dict[str, Any]) -> dict[str, Any]:
        return {**event, "cell_text": _text(cell_text.encode()).decode()}

    return with_event(first, masked) + b"".join(others)


def _text(data: bytes) -> bytes:
    """A cell file or a controller's config, masked; also where it is no TOML."""
    text = data.decode("utf-8", "surrogateescape")
    try:
        masked = without_secrets(text)
    except FileError:
        masked = with_lines_masked(text)
    return masked.encode("utf-8", "surrogateescape")


def _proposal(path: Path) -> bytes:
    change = ConfigChange.load(path)
    first, *further = (
        {"text_before": _text(before).decode(), "text_after": _text(after).decode()}
        for before, after in zip(change.before_contents, change.after_contents, strict=True)
    )
    files = zip(change.further, further, strict=True)
    masked = change.model_copy(
        update=first | {"further": tuple(one.model_copy(update=texts) for one, texts in files)}
    )
    sums = {
        "sha256_before": fingerprint_of(masked.before_contents),
        "sha256_after": fingerprint_of(masked.after_contents),
    }
    return masked.model_copy(update=sums).to_json()


def _passwords_in(cell_text: str) -> list[bytes]:
    try:
        document = TomlDocument.parse(cell_text)
    except FileError:
        return []
    return [str(document.value(path)).encode() for path in clear_secrets(document)]


def _wire(data: bytes, passwords: list[bytes]) -> bytes:
    lines = data.decode("utf-8", "replace").splitlines()
    return "".join(f"{_wire_line(line, passwords)}\n" for line in lines).encode()


def _wire_line(line: str, passwords: list[bytes]) -> str:
    """A line of a trace; its bytes stand in it twice."""
    parts = _WIRE_LINE.fullmatch(line)
    if parts is None:
        return line
    data = whole = bytes.fromhex(parts["bytes"])
    for password in filter(None, passwords):
        data = re.sub(rb"(?<!\S)" + re.escape(password) + rb"(?!\S)", MASK.encode(), data)
    data = _HALF_MASKED.sub(MASK.encode(), data)
    if data == whole:
        return line
    return f"{parts['head']}{data.hex(' ')}  {data.decode('ascii', 'replace').strip()}"
