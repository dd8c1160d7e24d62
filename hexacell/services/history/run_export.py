"""A copy of a run folder that may be given to others: the same run, its secrets masked.

Journal and trace of the wire are recorded without passwords; the files of configs may have secrets.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from hexacell.config.change import AFTER, BEFORE, RECEIPT, ConfigChange
from hexacell.config.layout import fingerprint_of
from hexacell.errors import FileError, UsageError
from hexacell.runs.run_folder import CELL_FILE, MEASUREMENTS, RESULT, RunFolder
from hexacell.storage import atomic_files
from hexacell.storage.toml_document import with_lines_masked, without_secrets
from procedures.journal.journal import read_entries
from procedures.resources.controller_config import PROVISIONAL_FOLDER

_CONFIG = re.compile(f"({BEFORE}|{AFTER})(-[0-9]+)?")
"""A file of a config, as it was or as it was written."""


def export_run(run: Path, target: Path) -> tuple[str, ...]:
    """Copy a run folder to ``target`` without its secrets; gives the names of the files in it.

    Only files that belong to a run are copied. The copy can be replayed. Raises ``UsageError`` if
    ``target`` is not empty, ``FileError`` if there is no whole journal, or the copy cannot be written.
    """
    folder = RunFolder(run)
    read_entries(folder.journal)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise UsageError("something is there already", subject=target, action="Name a new folder")
    names = []
    for name, data in _files(folder):
        atomic_files.create_folder_durably((target / name).parent)
        atomic_files.write_own(target / name, data)
        names.append(name)
    return tuple(names)


def _files(folder: RunFolder) -> Iterator[tuple[str, bytes]]:
    yield folder.journal.name, atomic_files.read_bytes(folder.journal)
    for name in (CELL_FILE, *_configs(folder.path)):
        if (text := _kept(folder, name)) is not None:
            yield name, _masked(text)
    traces = sorted(path.name for path in folder.path.glob(f"{folder.wire.name}*"))
    for name in (MEASUREMENTS, RESULT, RECEIPT, f"{PROVISIONAL_FOLDER}/{RECEIPT}", *traces):
        if (data := _kept(folder, name)) is not None:
            yield name, data
    if _kept(folder, folder.proposal.name) is not None:
        yield folder.proposal.name, _proposal(folder.proposal)


def _configs(folder: Path) -> Iterator[str]:
    for one in (folder, folder / PROVISIONAL_FOLDER):
        for path in sorted(one.iterdir()) if one.is_dir() else ():
            if _CONFIG.fullmatch(path.name):
                yield str(path.relative_to(folder))


def _kept(folder: RunFolder, name: str) -> bytes | None:
    """A file of the run; links are not followed, as they may lead anywhere."""
    path = folder.path / name
    return None if path.is_symlink() or path.parent.is_symlink() else atomic_files.read_if_present(path)


def _masked(data: bytes) -> bytes:
    """A cell file or a controller's config without secrets, also where it is not TOML."""
    text = data.decode("utf-8", "surrogateescape")
    try:
        masked = without_secrets(text)
    except FileError:
        masked = with_lines_masked(text)
    return masked.encode("utf-8", "surrogateescape")


def _proposal(path: Path) -> bytes:
    change = ConfigChange.load(path)
    first, *further = (
        {"text_before": _masked(before).decode(), "text_after": _masked(after).decode()}
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
