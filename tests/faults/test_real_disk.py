"""Full disks, files at their size limit and read-only folders of a real file system.

Faults that other tests inject are real here: a file system in memory of a few hundred kilobytes, in a
mount namespace of its own, the kernel's limit on the size of files, and permissions.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.faults.cell import WHATEVER_IS_FREE, Site, make_site
from tests.faults.conftest import ROOT, Program
from tests.faults.killing import finish
from tests.faults.promises import require_identical
from tests.signals import terminal_signals

NOBODY = 65534
IN_A_NAMESPACE = ["unshare", "--mount", "--propagation", "private", "sh", "-c"]
MOUNTED = 'mount -t tmpfs -o size="$1" none "$2" && shift 2 && exec "$@"'
SIZE = 1 << 20


@dataclass(frozen=True)
class SmallDisk:
    """A file system that is soon full, and the program on it."""

    program: Program
    site: Site
    free: Callable[[], None]


@pytest.fixture
def small_disk(tmp_path: Path, ground: Path) -> Iterator[Callable[[int], SmallDisk]]:
    """Makes one with a cell on it and so many bytes left; ``free`` gives the others back."""
    if shutil.which("unshare") is None or subprocess.run([*IN_A_NAMESPACE, "true"], check=False).returncode:
        pytest.skip("no file system can be mounted here")
    server = [sys.executable, "-m", "tests.faults.driver"]
    with terminal_signals():
        starting = subprocess.Popen(
            [*IN_A_NAMESPACE, MOUNTED, "sh", str(SIZE), tmp_path, *server],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
    with starting as process:
        program = Program(process, ground)
        # The namespace's folder under a name that leads there from everywhere.
        disk = Path(f"/proc/{process.pid}/root{tmp_path}")
        yield lambda left: _filled(program, disk, left)
        assert process.stdin is not None
        process.stdin.close()


def _filled(program: Program, disk: Path, left: int) -> SmallDisk:
    shutil.rmtree(disk / "cell", ignore_errors=True)
    site = make_site(disk / "cell", WHATEVER_IS_FREE)
    ballast, state = disk / "ballast", os.statvfs(disk)
    ballast.write_bytes(bytes(state.f_bavail * state.f_bsize - left))
    return SmallDisk(program, site, ballast.unlink)


def fill_up(left: int, small_disk: Any, undisturbed: Any) -> None:
    disk = small_disk(left)
    ended = disk.program.run(disk.site)
    assert ended.code == 2, ended.words
    assert "the disk is full. Free some space and try again" in ended.words
    assert disk.site.config.read_bytes() == undisturbed.config_before
    disk.free()
    finish(disk.program, disk.site)
    require_identical(disk.site, undisturbed.site)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_run_on_a_disk_that_fills_up_at_any_size_can_be_resumed(small_disk, undisturbed):
    used = sum(path.stat().st_size for path in undisturbed.folder.path.iterdir())
    for left in range(0, used - undisturbed.folder.wire.stat().st_size, 12_288):
        fill_up(left, small_disk, undisturbed)


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


class TestPermissions:
    """Each is refused before anything moves."""

    @pytest.fixture
    def refused(self, program: Any, ground: Path, user: int | None, undisturbed: Any) -> Any:
        def run(site: Site, words: str) -> None:
            ground.chmod(0o777)
            ended = program.run(site, user=user)
            assert ended.code == 2, ended.words
            assert words in ended.words
            assert site.config.read_bytes() == undisturbed.config_before
            assert not site.runs()

        return run

    def test_a_read_only_cell_folder_is_refused(self, new_site: Any, refused: Any) -> None:
        site = new_site()
        site.folder.chmod(0o555)
        refused(site, "Have the owner of the folder create it once, empty, with mode 644")

    def test_a_read_only_runs_folder_is_refused(self, new_site: Any, refused: Any) -> None:
        site = new_site()
        site.folder.chmod(0o777)
        runs = site.folder / "runs"
        runs.mkdir(mode=0o555)
        refused(site, f"{runs}")
