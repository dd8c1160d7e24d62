"""Child processes of tests have a terminal's signals, whatever the test run ignores or blocks."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.signals import NUMBERS, terminal_signals

IGNORED = [number for number in NUMBERS if number is not signal.SIGPIPE]

TELL = """
import json, signal
numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
ignored = [n for n in numbers if signal.getsignal(n) is signal.SIG_IGN]
print(json.dumps([ignored, sorted(signal.pthread_sigmask(signal.SIG_BLOCK, ()))]))
"""


@pytest.fixture
def background_job() -> Iterator[None]:
    """This process as below ``nohup`` in the background of a script, with a signal blocked besides."""
    before = {number: signal.signal(number, signal.SIG_IGN) for number in IGNORED}
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    yield
    signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    for number, handler in before.items():
        signal.signal(number, handler)


def ignored_and_blocked_in_a_child() -> list[list[int]]:
    child = subprocess.run([sys.executable, "-c", TELL], capture_output=True, text=True, check=True)
    answer: list[list[int]] = json.loads(child.stdout)
    return answer


@pytest.mark.usefixtures("background_job")
def test_a_child_has_the_signals_of_a_terminal() -> None:
    assert ignored_and_blocked_in_a_child() == [[2, 15, 1, 3], [15]]
    with terminal_signals():
        assert ignored_and_blocked_in_a_child() == [[], []]


@pytest.mark.usefixtures("background_job")
def test_the_signals_of_the_test_run_are_restored() -> None:
    with terminal_signals():
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert [signal.getsignal(number) for number in IGNORED] == [signal.SIG_IGN] * len(IGNORED)
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == {signal.SIGTERM}
