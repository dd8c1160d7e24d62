"""Running the owner's reload command."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import sys

import pytest

from drivers.controllers.linuxcnc.startup import run_reload_command
from hexacell.errors import DeviceError
from tests.waiting import until


def python(program: str) -> tuple[str, ...]:
    return (sys.executable, "-c", program)


async def test_a_reload_command_that_cannot_be_run_is_reported(tmp_path):
    absent = str(tmp_path / "absent")
    with pytest.raises(DeviceError, match="absent' cannot be run: No such file or directory"):
        await run_reload_command((absent,), "controller", 5.0)


async def test_a_program_installed_beside_this_one_is_found_without_a_path_to_it(monkeypatch):
    monkeypatch.setenv("PATH", os.defpath)
    assert shutil.which("hexacell") is None
    await run_reload_command(("hexacell", "--version"), "controller", 60.0)


async def test_a_reload_command_that_exceeds_its_timeout_is_killed(tmp_path):
    with pytest.raises(DeviceError, match=r"took longer than 0\.3 s"):
        await run_reload_command(_saying_who(tmp_path), "controller", 0.3)
    if (tmp_path / "pid").exists():  # else it was killed before it could say
        _expect_gone(tmp_path)


async def test_a_cancelled_reload_command_is_killed(tmp_path):
    running = asyncio.create_task(run_reload_command(_saying_who(tmp_path), "controller", 1800.0))
    await until((tmp_path / "pid").exists)
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    _expect_gone(tmp_path)


async def test_a_daemon_that_it_starts_is_not_waited_for(tmp_path):
    await run_reload_command(("sh", "-c", f"sleep 3600 & echo $! > {tmp_path}/pid"), "controller", 1800.0)
    os.kill(int((tmp_path / "pid").read_text()), signal.SIGKILL)


async def test_only_the_end_of_a_long_output_is_shown():
    talking = "import sys; print('x' * 10_000); sys.exit('the end')"
    with pytest.raises(DeviceError, match="xxx\nthe end") as caught:
        await run_reload_command(python(talking), "controller", 5.0)
    assert len(caught.value.problem) < 600


def _saying_who(folder):
    return ("sh", "-c", f"echo $$ > {folder}/new; mv {folder}/new {folder}/pid; exec sleep 3600")


def _expect_gone(folder):
    with pytest.raises(ProcessLookupError):
        os.kill(int((folder / "pid").read_text()), 0)
