"""The command that makes a controller read its config again."""

from __future__ import annotations

import asyncio
import tempfile
from typing import IO

from hexacell.errors import DeviceError

_SHOWN = 400


async def run(command: tuple[str, ...], subject: str, patience_s: float) -> None:
    """Run ``command`` to its end; it is killed when this is cancelled.

    What it writes goes to a file and not a pipe: a daemon that it leaves behind would hold the
    pipe open for ever.

    Raises:
        DeviceError: It cannot be run, fails (its own last words are shown) or takes too long.
    """
    with tempfile.TemporaryFile() as output:
        process = await _start(command, subject, output)
        try:
            async with asyncio.timeout(patience_s):
                status = await process.wait()
        except TimeoutError:
            raise _failure(f"took longer than {patience_s:g} s", command, subject) from None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        if status != 0:
            raise _failure(f"failed with status {status}{_last_words(output)}", command, subject)


async def _start(command: tuple[str, ...], subject: str, output: IO[bytes]) -> asyncio.subprocess.Process:
    try:
        return await asyncio.create_subprocess_exec(
            *command, stdin=asyncio.subprocess.DEVNULL, stdout=output, stderr=output
        )
    except OSError as error:
        problem = f"cannot be run: {error.strerror or error}"
        raise _failure(problem, command, subject) from error


def _failure(problem: str, command: tuple[str, ...], subject: str) -> DeviceError:
    return DeviceError(
        f"the reload command '{' '.join(command)}' {problem}",
        subject=subject,
        action="Correct controller.reload_command; the machine is off",
    )


def _last_words(output: IO[bytes]) -> str:
    output.seek(0)
    text = output.read().decode("utf-8", "replace").strip()[-_SHOWN:]
    return f": {text}" if text else ""
