"""A journal in a folder of its own, empty or written."""

import zlib
from pathlib import Path
from typing import Any

import pytest

from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.steps import events
from tests.recorded_events import record


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def written(path: Path) -> bytes:
    return write_told(path)


TOLD: tuple[Any, ...] = (
    events.Proposed(
        gates=(AcceptanceGate(name="converged", passed=True, sentence="It did to 0.5 µm."),), written={}
    ),
    events.Committed(approved_by="a tester"),
    events.Interrupted(reason="line one\nline two\u2028\x85\r", exit_code=130),
    events.Ended(exit_code=1, line="rolled back"),
)


def write_told(path: Path) -> bytes:
    record(path, TOLD)
    return path.read_bytes()


def checked(body: bytes) -> bytes:
    """A line with the checksum that belongs to it; ``body`` is the line without."""
    return body[:-1] + b',"crc":"%08x"}\n' % zlib.crc32(body)
