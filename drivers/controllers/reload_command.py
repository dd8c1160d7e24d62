"""The command of the cell file that makes a controller read its config again."""

import asyncio
import os
import sys
import tempfile
from pathlib import Path

from hexacell.errors import DeviceError
from hexacell.storage.atomic_files import read_end

_SHOWN_CHARACTERS = 400


def path_with_own_programs() -> str:
    """Where programs are looked for: those that were installed together with this one, too."""
    return os.pathsep.join((os.environ.get("PATH", os.defpath), str(Path(sys.executable).parent)))


async def run_reload_command(command: tuple[str, ...], subject: str, timeout_s: float) -> None:
    """Run the command that makes a controller reload its config to its end; kill it on cancellation.

    Its output goes to a file, not to a pipe: a daemon that it starts would hold a pipe open for ever.

    Raises:
        DeviceError: It cannot be run, fails (the end of its output is shown) or takes too long.
    """

    def failure(problem: str) -> DeviceError:
        return DeviceError(
            f"the reload command '{' '.join(command)}' {problem}",
            subject=subject,
            action="Correct controller.reload_command; the machine is off",
        )

    with tempfile.TemporaryFile() as output:
        try:
            process = await asyncio.create_subprocess_exec(
                *command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env=os.environ | {"PATH": path_with_own_programs()},
            )
        except OSError as error:
            raise failure(f"cannot be run: {error.strerror or error}") from error
        try:
            async with asyncio.timeout(timeout_s):
                status = await process.wait()
        except TimeoutError:
            raise failure(f"took longer than {timeout_s:g} s") from None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        if status != 0:
            said = read_end(output, _SHOWN_CHARACTERS)
            raise failure(f"failed with status {status}" + (f": {said}" if said else ""))
