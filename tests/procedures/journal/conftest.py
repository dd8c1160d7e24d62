"""A journal in a folder of its own, empty or written."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.procedures.journal.told import write_told


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def written(path: Path) -> bytes:
    return write_told(path)
