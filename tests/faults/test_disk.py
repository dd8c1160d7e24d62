"""A disk that is full, read-only, forbidden or broken at every write of a run.

A first run counts the calls that change files. Then the program is run again and again, each time
with another of them failing: the message, the content of the controller's config, and whether the
run resumes once the disk works again are checked.
"""

import errno
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.faults.cell import Site
from tests.faults.promises import finish, history_of, require_identical
from tests.faults.steps import step_of

ERRORS = {
    errno.ENOSPC: ("disk full", "the disk is full. Free some space"),
    errno.EROFS: ("read-only", "the file system is read-only. Mount it writable"),
    errno.EACCES: ("permission denied", "permission denied. "),
    errno.EIO: ("disk error", "the disk reports an error. Check the disk"),
}

ACTIONS = ("and apply the proposal again", "config-before over the config")
"""What else there is to do where the config was replaced already."""

TOLD = (
    "may hold the new geometry",
    "was replaced",
    "the controller has the new geometry",
    "the controller has a provisional geometry",
)
"""What must be said where a config that was not noted as written is there all the same."""


@dataclass(frozen=True)
class Write:
    """A call that changes a file: the how manieth it is, which it is, and in which step."""

    number: int
    name: str
    file: str
    step: str


@pytest.fixture(scope="session")
def writes(undisturbed: Any) -> Sequence[Write]:
    return writes_of(undisturbed)


def writes_of(whole: Any) -> Sequence[Write]:
    """Every call of a run that changes a file."""
    ended = whole.ended
    becoming = {call.path: call.other for call in ended.calls if call.other}
    found, records = [], 0
    for number, call in enumerate(ended.calls):
        concerned = Path(becoming.get(call.path, call.path)).name  # a temporary is what it becomes
        file = "run folder" if concerned.startswith("20") else concerned
        found.append(Write(number, call.name, file, step_of(whole.history[:records])))
        records += (call.name, file) == ("fsync", "journal.jsonl")
    return found


def of_each_kind(writes: Sequence[Write]) -> list[Write]:
    """The first call of each kind: on the same file, in the same kind of step."""
    kinds: dict[tuple[str, str, str], Write] = {}
    for write in writes:
        kinds.setdefault((write.name, write.file, write.step), write)
    return list(kinds.values())


class Disk:
    """Runs the program on a disk that fails at one write, once or from then on."""

    def __init__(self, program: Any, new_site: Any, whole: Any) -> None:
        self._program, self._new_site, self._whole = program, new_site, whole

    def fail(self, write: Write, code: int, *, width: int | None = None, and_resume: bool = True) -> str:
        """Give what the program said to it."""
        site = self._new_site(*self._whole.changes)
        failing = {"at": write.number, "width": width, "error": code}
        ended = self._program.run(site, failing=failing)
        self._require_told(site, write, ended, ERRORS[code][1])
        over = ended.code == self._whole.ended.code
        if and_resume and not over:
            finish(self._program, site, code=self._whole.ended.code)
        if and_resume or over:
            require_identical(site, self._whole.site)
        return str(ended.words)

    def _require_told(self, site: Site, write: Write, ended: Any, words: str) -> None:
        """Whatever came of it, the config is complete and the words are true."""
        found = self._whole.name_of(site.config.read_bytes())
        noted = {"new": "committed", "lent": "lent"}.get(found)
        is_noted = any(event.kind == noted for event in history_of(site))
        if ended.code == self._whole.ended.code:
            return
        why, _, action = words.partition(". ")
        assert why in ended.words, (write, ended)
        assert any(words in ended.words for words in (action, *ACTIONS)), (write, ended)
        assert str(site.folder) in ended.words, (write, ended)
        assert ended.code in {2, 6}, (write, ended)
        if ended.code == 6:
            assert found == "old", (write, ended)
        if noted and not is_noted:
            assert any(words in ended.words for words in TOLD), (write, ended)


@pytest.fixture
def disk(program: Any, new_site: Any, undisturbed: Any) -> Disk:
    return Disk(program, new_site, undisturbed)


def the(writes: Sequence[Write], name: str, file: str, step: str = "") -> Write:
    return next(w for w in writes if (w.name, w.file) == (name, file) and step in {"", w.step})


def test_a_disk_full_while_measuring_is_reported_as_the_journal(disk, writes):
    write = the(writes, "write", "journal.jsonl", "sampling")
    words = disk.fail(write, errno.ENOSPC, and_resume=False)
    assert "journal.jsonl: the journal cannot be written" in words, "not what failed afterwards"


@pytest.mark.slow
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("code", ERRORS, ids=[words for words, _ in ERRORS.values()])
def test_a_failure_of_any_write_leaves_a_valid_config(code, disk, writes):
    """All later writes fail too; for the first write of a kind the run is also finished on a good disk."""
    kinds = of_each_kind(writes)
    for write in writes:
        disk.fail(write, code, and_resume=write in kinds)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("step", ["lending", "taking back", "rolling back"])
def test_a_full_disk_at_any_write_of_a_config_reversal_leaves_a_valid_config(
    step: str, program: Any, new_site: Any, whole_with: Any
) -> None:
    whole = whole_with(step)
    disk = Disk(program, new_site, whole)
    for write in writes_of(whole):
        if write.step == step:
            disk.fail(write, errno.ENOSPC)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_single_disk_error_in_any_kind_of_write_leaves_a_valid_config(disk, writes):
    for write in of_each_kind(writes):
        disk.fail(write, errno.EIO, width=1)


NOBODY = 65534


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_run_ended_by_the_file_size_limit_can_be_resumed(share, program, new_site, undisturbed):
    """The kernel writes what still fits: half a record."""
    site = new_site()
    limit = int(share * undisturbed.folder.journal.stat().st_size)
    ended = program.run(site, file_size_limit=limit)
    assert ended.code == 2, ended.words
    assert "it may not become larger. Raise the limit on the size of files" in ended.words
    assert site.config.read_bytes() == undisturbed.config_before
    finish(program, site)
    require_identical(site, undisturbed.site)


@pytest.fixture
def user() -> int | None:
    """Somebody to whom permissions apply; root may do everything."""
    return NOBODY if os.geteuid() == 0 else None


@pytest.mark.parametrize(
    ("modes", "words"),
    [
        ((0o555,), "Have the owner of the folder create it once, empty, with mode 644"),
        ((0o777, 0o555), "runs"),
    ],
    ids=["cell folder", "runs folder"],
)
def test_a_read_only_folder_is_refused_before_anything_moves(
    program: Any, new_site: Any, ground: Path, user: int | None, undisturbed: Any, modes: Any, words: str
) -> None:
    site = new_site()
    ground.chmod(0o777)
    for folder, mode in zip((site.folder, site.folder / "runs"), modes, strict=False):
        folder.mkdir(exist_ok=True)
        folder.chmod(mode)
    ended = program.run(site, user=user)
    assert ended.code == 2, ended.words
    assert (str(site.folder / words) if words == "runs" else words) in ended.words
    assert site.config.read_bytes() == undisturbed.config_before
    assert not site.runs()
