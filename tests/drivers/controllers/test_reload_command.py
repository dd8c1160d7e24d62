"""Running the owner's reload command."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time

import pytest

from drivers.controllers import reload_command
from hexacell.errors import DeviceError


def python(program: str) -> tuple[str, ...]:
    return (sys.executable, "-c", program)


async def test_one_that_cannot_be_run(tmp_path):
    absent = str(tmp_path / "absent")
    with pytest.raises(DeviceError, match="absent' cannot be run: No such file or directory"):
        await reload_command.run((absent,), "controller", 5.0)


async def test_one_that_takes_too_long_is_killed(tmp_path):
    begun = time.monotonic()
    with pytest.raises(DeviceError, match=r"took longer than 0\.3 s"):
        await reload_command.run(_saying_who(tmp_path), "controller", 0.3)
    assert time.monotonic() - begun < 5.0
    _expect_gone(tmp_path)


async def test_a_cancelled_one_is_killed(tmp_path):
    running = asyncio.create_task(reload_command.run(_saying_who(tmp_path), "controller", 60.0))
    while not (tmp_path / "pid").exists():  # noqa: ASYNC110 - another process writes it
        await asyncio.sleep(0.01)
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    _expect_gone(tmp_path)


async def test_a_daemon_that_it_leaves_behind_does_not_hold_us_up(tmp_path):
    begun = time.monotonic()
    await reload_command.run(("sh", "-c", f"sleep 30 & echo $! > {tmp_path}/pid"), "controller", 25.0)
    os.kill(int((tmp_path / "pid").read_text()), signal.SIGKILL)
    assert time.monotonic() - begun < 20.0


async def test_only_the_last_words_of_a_talkative_one_are_shown():
    talking = "import sys; print('x' * 10_000); sys.exit('the end')"
    with pytest.raises(DeviceError, match="xxx\nthe end") as caught:
        await reload_command.run(python(talking), "controller", 5.0)
    assert len(caught.value.problem) < 600


def _saying_who(folder):
    return ("sh", "-c", f"echo $$ > {folder}/new; mv {folder}/new {folder}/pid; exec sleep 60")


def _expect_gone(folder):
    with pytest.raises(ProcessLookupError):
        os.kill(int((folder / "pid").read_text()), 0)
