"""The command that makes a controller reload its config."""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
from pathlib import Path
from typing import IO

from hexacell.errors import DeviceError

_SHOWN_CHARACTERS = 400


async def run(command: tuple[str, ...], subject: str, timeout_s: float) -> None:
    """Run ``command`` to its end; kill it on cancellation.

    Programs that were installed together with this one are found wherever it was started from.
    Its output goes to a file, not to a pipe: a daemon that it starts would hold a pipe open for ever.

    Raises:
        DeviceError: It cannot be run, fails (the end of its output is shown) or takes too long.
    """
    with tempfile.TemporaryFile() as output:
        process = await _start(command, subject, output)
        try:
            async with asyncio.timeout(timeout_s):
                status = await process.wait()
        except TimeoutError:
            raise _failure(f"took longer than {timeout_s:g} s", command, subject) from None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        if status != 0:
            raise _failure(f"failed with status {status}{_end_of_output(output)}", command, subject)


async def _start(command: tuple[str, ...], subject: str, output: IO[bytes]) -> asyncio.subprocess.Process:
    try:
        return await asyncio.create_subprocess_exec(
            *command, stdin=asyncio.subprocess.DEVNULL, stdout=output, stderr=output, env=_environment()
        )
    except OSError as error:
        problem = f"cannot be run: {error.strerror or error}"
        raise _failure(problem, command, subject) from error


def _environment() -> dict[str, str]:
    beside_this = str(Path(sys.executable).parent)
    return os.environ | {"PATH": os.pathsep.join((os.environ.get("PATH", os.defpath), beside_this))}


def _failure(problem: str, command: tuple[str, ...], subject: str) -> DeviceError:
    return DeviceError(
        f"the reload command '{' '.join(command)}' {problem}",
        subject=subject,
        action="Correct controller.reload_command; the machine is off",
    )


def _end_of_output(output: IO[bytes]) -> str:
    output.seek(0)
    text = output.read().decode("utf-8", "replace").strip()[-_SHOWN_CHARACTERS:]
    return f": {text}" if text else ""
