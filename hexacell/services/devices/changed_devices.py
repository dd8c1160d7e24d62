"""Devices that are not what they were when the cell was last run: exchanged, set anew, plugged elsewhere.

That may be on purpose, and a new run takes them as they are. But a preset, a reversed direction or an
exchanged encoder changes what a robot is thought to do, so it is a remark of the device.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace

from drivers.interfaces import DeviceIdentity
from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.runs.run_folder import RunFolder, run_folders
from procedures.journal.line_format import decode
from procedures.steps import events

COMPARED = {
    "protocol": "protocol",
    "description": "device",
    "serial_number": "serial number",
    "settings": "settings",
    "port": "port",
}


def with_changes(cell: Cell, found: Iterable[DeviceIdentity]) -> tuple[DeviceIdentity, ...]:
    """Devices as found, each with a remark on what differs from the last run that can be read."""
    run, known = _last(cell)
    return tuple(_remarked(one, known.get(one.name), run) for one in found)


def _last(cell: Cell) -> tuple[str, dict[str, DeviceIdentity]]:
    """The name of the last run, which its time is, and the devices with which it began."""
    for folder in reversed(run_folders(cell)):
        started = _started(folder)
        if started is not None and started.devices:
            return folder.name, {one.name: one for one in started.devices}
    return "", {}


def _started(run: RunFolder) -> events.RunStarted | None:
    """The first event of a run; None where it cannot be read."""
    with suppress(OSError, HexacellError), run.journal.open("rb") as journal:
        entry = decode(journal.readline(), run.journal, 1)
        if entry is not None and isinstance(entry.event, events.RunStarted):
            return entry.event
    return None


def _remarked(now: DeviceIdentity, then: DeviceIdentity | None, run: str) -> DeviceIdentity:
    """A device with its changes in words; what the earlier run did not know is no change."""
    changes = []
    for field, word in COMPARED.items():
        before, after = getattr(then, field, None), getattr(now, field)
        if before and before != after:
            changes.append(f"{word} {after or 'none'}, which was {before}")
    if not changes:
        return now
    remark = f"since the run {run}: {', '.join(changes)}"
    return replace(now, remark="; ".join(filter(None, (now.remark, remark))))
