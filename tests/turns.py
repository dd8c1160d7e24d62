"""Long tests take turns: ``make test`` runs a third of them, ``make test-full`` all.

``long_tests.txt`` lists those that take more than a second of processor time, in all their cases together.
"""

import contextlib
import os
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from zlib import crc32

import pytest

TURN = "HEXACELL_TURN"
"""In the environment: whose turn it is, 0, 1 or 2."""

TURNS = 3
LONG_TESTS = Path(__file__).with_name("long_tests.txt")


def turn() -> int:
    """Whose turn it is: by the number of commits, so that the next one runs others; 0 without git."""
    if TURN not in os.environ:  # processes that share the tests are told by the first one
        command = ("git", "rev-list", "--count", "HEAD")
        commits = "0"
        with contextlib.suppress(OSError, subprocess.CalledProcessError):
            commits = subprocess.check_output(
                command, cwd=LONG_TESTS.parent, text=True, stderr=subprocess.DEVNULL
            )
        os.environ[TURN] = str(int(commits) % TURNS)
    return int(os.environ[TURN])


def listed_tests() -> frozenset[str]:
    """Their names, without the parameters of their cases."""
    return frozenset(LONG_TESTS.read_text().split())


def whose_turn_it_is_not(items: Iterable[pytest.Item]) -> Iterator[pytest.Item]:
    """Of these tests the long ones that other commits run, each case for itself."""
    listed = listed_tests()
    for item in items:
        if name_of(item) in listed and crc32(item.nodeid.encode()) % TURNS != turn():
            yield item


def not_there(items: Iterable[pytest.Item]) -> set[str]:
    """The listed tests that are not in their file, where that was collected."""
    there = {name_of(item) for item in items}
    files = {name.partition("::")[0] for name in there}
    return {one for one in listed_tests() - there if one.partition("::")[0] in files}


def name_of(item: pytest.Item) -> str:
    """The name of a test without the parameters of its case."""
    return item.nodeid.partition("[")[0]
