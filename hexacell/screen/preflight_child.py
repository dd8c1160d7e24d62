"""A preflight in a process of its own; prints what it found as JSON."""

from __future__ import annotations

import asyncio
import json
import sys
from dataclasses import asdict
from pathlib import Path

from hexacell.cell.loader import load_cell
from hexacell.errors import HexacellError
from hexacell.services.run.calibration_run import preflight
from hexacell.text.planning import device_line
from hexacell.text.screens.live import failed_items, passed_items
from hexacell.text.screens.views import ChecklistItem
from procedures.calibration.calibration import Mode


def found_items(path: Path, mode: Mode) -> tuple[tuple[ChecklistItem, ...], bool]:
    """What a preflight finds, and whether a run may begin."""
    try:
        devices = asyncio.run(preflight(load_cell(path), mode, unattended=False))
    except HexacellError as error:
        return failed_items(error), False
    return passed_items([device_line(one) for one in devices]), True


if __name__ == "__main__":
    items, is_ready = found_items(Path(sys.argv[1]), Mode(sys.argv[2]))
    sys.stdout.write(json.dumps({"items": [asdict(item) for item in items], "is_ready": is_ready}))
