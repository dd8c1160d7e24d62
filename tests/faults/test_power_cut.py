"""A power cut at every call of a run that changes a file, with every disk content that it may leave."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hexacell.config.change import Receipt
from hexacell.config.write_back import rollback
from tests.faults.interception import Call
from tests.faults.power_cut import Disk, Files

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
