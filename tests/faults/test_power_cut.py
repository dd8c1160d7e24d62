"""A power cut at every call of a run that changes a file, with every disk content that it may leave.

What a disk may hold is a model, fed with the calls that a program made. What was not forced to the disk
may be there or not. Data since the last ``fsync`` of a file may be missing, half there, or whole; of the
changes of a folder since its own last ``fsync`` any may be missing, whatever their order. Real file systems
allow less (ext4 keeps the order of changes within a folder), so what holds here holds there. It is the
method of crash-consistency checkers such as ALICE (Pillai et al., OSDI 2014), for the few calls made here.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path, PurePosixPath
from typing import Any

import pytest

from hexacell.config.change import Receipt
from hexacell.config.write_back import rollback
from tests.faults.interception import Call

Files = Mapping[str, bytes]
"""What is found afterwards: content by path."""


@dataclass(eq=False)
class _File:
    durable: bytes = b""
    data: bytes = b""

    def possible(self) -> tuple[bytes, ...]:
        half = self.data[: (len(self.durable) + len(self.data)) // 2]
        return tuple(dict.fromkeys((self.durable, half, self.data)))


@dataclass(eq=False)
class _Folder:
    """Names, as they are on the disk for sure, and the changes that may not be there yet."""

    durable: dict[str, _File | _Folder] = field(default_factory=dict)
    changes: list[tuple[str | None, str, _File | _Folder | None]] = field(default_factory=list)

    def change(self, gone: str | None, name: str, item: _File | _Folder | None) -> None:
        """One change: a name that goes, and one that stands for something else, or nothing, from now on."""
        self.changes.append((gone, name, item))

    def after(self, *, which: tuple[bool, ...] | None = None) -> dict[str, _File | _Folder]:
        """The names with all changes made, or with some."""
        names = dict(self.durable)
        made = zip(self.changes, which or (True,) * len(self.changes), strict=True)
        for gone, name, item in (change for change, really in made if really):
            names.pop(gone or "", None)
            names.pop(name, None)
            if item is not None:
                names[name] = item
        return names

    def possible(self) -> Iterator[dict[str, _File | _Folder]]:
        for which in product((True, False), repeat=len(self.changes)):
            yield self.after(which=which)


class Disk:
    """A folder on a disk that may lose its power at any moment."""

    def __init__(self, folder: str, files: Files) -> None:
        self._root = PurePosixPath(folder)
        self._top = _Folder({name: _File(data, data) for name, data in files.items()})

    def do(self, call: Call) -> None:
        """Let one call happen; one that the file system refused then changes nothing."""
        folder, name = self._place(call.path)
        if folder is None:
            return
        item = folder.after().get(name) if name else folder
        match call.name, item:
            case "open", None:
                folder.change(None, name, _File())
            case "mkdir", None:
                folder.change(None, name, _Folder())
            case "unlink", _File():
                folder.change(None, name, None)
            case "replace", _File():
                folder.change(name, PurePosixPath(call.other).name, item)
            case "write", _File():
                item.data += call.data
            case "ftruncate", _File():
                item.data = item.data[: call.length]
            case "fsync", _File():
                item.durable = item.data
            case "fsync", _Folder():
                item.durable, item.changes = item.after(), []

    def possible(self) -> Iterator[Files]:
        """Everything that may be found if the power goes now."""
        for found in self._possible(self._top, ""):
            yield dict(found)

    def _possible(self, folder: _Folder, prefix: str) -> Iterator[tuple[tuple[str, bytes], ...]]:
        for names in folder.possible():
            parts = [list(self._of(item, prefix + name)) for name, item in names.items()]
            for combination in product(*parts):
                yield tuple(pair for part in combination for pair in part)

    def _of(self, item: _File | _Folder, path: str) -> Iterator[tuple[tuple[str, bytes], ...]]:
        if isinstance(item, _Folder):
            yield from self._possible(item, path + "/")
        else:
            yield from (((path, data),) for data in item.possible())

    def _place(self, path: str) -> tuple[_Folder | None, str]:
        """The folder of a path and the last name; no folder where there is none, no name for the top."""
        *above, name = ("", *PurePosixPath(path).relative_to(self._root).parts)
        folder = self._top
        for part in above[1:]:
            inner = folder.after().get(part)
            if not isinstance(inner, _Folder):
                return None, ""
            folder = inner
        return folder, name


CONFIG = "simulated-hexaglide.controller.toml"
OWN = {"cell.toml", "measurements.csv", "result.json", "proposal.json", "config-before", "config-after"}
OWN |= {"write-back.json", "wire"}
"""Files of a run that are written once and whole."""


class Story:
    """A run that nothing disturbed, and a folder in which to look at what a power cut leaves of it."""

    def __init__(self, whole: Any, folder: Path) -> None:
        self.folder = folder
        self.ran_in = str(whole.site.folder)
        self.before, self.after = whole.config_before, whole.config_after
        self.start = {CONFIG: self.before, "cell.toml": whole.site.cell_path.read_bytes()}
        self.calls: tuple[Call, ...] = whole.ended.calls
        run = whole.folder.path
        self.run = str(run.relative_to(whole.site.folder))
        self.end = {path.name: path.read_bytes() for path in run.iterdir()}

    def cuts(self) -> Iterator[tuple[int, Files]]:
        """For every moment: how many records were on the disk for sure, and what may be found."""
        disk, sure = Disk(self.ran_in, self.start), 0
        for call in self.calls:
            for found in disk.possible():
                yield sure, found
            disk.do(call)
            sure += call.name == "fsync" and call.path.endswith("journal.jsonl")
        for found in disk.possible():
            yield sure, found

    def put_down(self, found: Files) -> None:
        """Make the folder what was found, as if the run had been in it."""
        shutil.rmtree(self.folder, ignore_errors=True)
        for name, data in found.items():
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data.replace(self.ran_in.encode(), str(self.folder).encode()))

    def require_kept(self, sure: int, found: Files) -> None:
        """Every record that the engine went on from is there, and no file is half there."""
        journal = found.get(f"{self.run}/journal.jsonl", b"")
        lines = self.end["journal.jsonl"].splitlines(keepends=True)
        assert journal.startswith(b"".join(lines[:sure]))
        assert self.end["journal.jsonl"].startswith(journal)
        for name in OWN & {Path(path).name for path in found if path.startswith(self.run)}:
            assert found[f"{self.run}/{name}"] == self.end[name], name

    def require_way_back(self, found: Files) -> None:
        """A config that is not the old one is the new one, whole, and rolling back restores the old."""
        assert found[CONFIG] == self.after
        self.put_down(found)
        rollback(Receipt.of(self.folder / self.run))
        assert (self.folder / CONFIG).read_bytes() == self.before


def cut_everywhere(story: Story) -> None:
    seen: set[frozenset[tuple[str, bytes]]] = set()
    for sure, found in story.cuts():
        story.require_kept(sure, found)
        is_new = found[CONFIG] != story.before
        state = frozenset(found.items())
        if is_new and state not in seen:
            story.require_way_back(found)
        seen.add(state)


@pytest.mark.parametrize("whole", ["undisturbed", pytest.param("rolled_back", marks=pytest.mark.slow)])
def test_a_run_survives_a_power_cut_at_any_file_operation(whole, program, request, ground) -> None:
    cut_everywhere(Story(request.getfixturevalue(whole), ground / "cell"))
