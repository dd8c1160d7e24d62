"""Long computations in a process of their own: keys are heard meanwhile, and quitting ends it at once."""

from __future__ import annotations

import asyncio
import json
import sys
from asyncio.subprocess import DEVNULL, PIPE
from pathlib import Path
from typing import Any

from hexacell.errors import HexacellError


async def run_child(module: str, cell: Path, *more: str) -> Any:  # noqa: ANN401 - what JSON can hold
    """Run ``python -m module CELL``, with ``more`` behind it, and give the JSON document that it prints.

    Raises:
        HexacellError: it printed none.
    """
    command = (sys.executable, "-m", module, str(cell), *more)
    process = await asyncio.create_subprocess_exec(*command, stdin=DEVNULL, stdout=PIPE, stderr=DEVNULL)
    try:
        printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    try:
        return json.loads(printed)
    except ValueError as error:
        raise HexacellError(
            "the computation ended without a result", action="Try `hexacell preflight` in another terminal"
        ) from error
