"""Runs that have come to where they are disturbed."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from procedures.journal.journal import Journal


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def journal(path: Path) -> Iterator[Journal]:
    with Journal(path) as opened:
        yield opened
