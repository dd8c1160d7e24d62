"""Files at the kernel's size limit, and read-only folders of a real file system: nothing is injected."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from tests.faults.cell import Site
from tests.faults.killing import finish
from tests.faults.promises import require_identical

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
