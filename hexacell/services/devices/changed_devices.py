"""Devices that are not what they were when the cell was last run: exchanged, set anew, plugged elsewhere.

That may be on purpose, and a new run takes them as they are. But a preset, a reversed direction or an
exchanged encoder changes what a robot is thought to do, so it is a remark of the device.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace

from drivers.interfaces import DeviceIdentity
from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.runs.run_folder import run_folders
from procedures.journal.journal import decode
from procedures.steps import events

COMPARED = {
    "protocol": "protocol",
    "description": "device",
    "serial_number": "serial number",
    "settings": "settings",
    "port": "port",
}


def with_changes(cell: Cell, found: Iterable[DeviceIdentity]) -> tuple[DeviceIdentity, ...]:
    """Devices as found, each with a remark on what differs from the last run that can be read.

    What the earlier run did not know is no change. The name of a run is its time.
    """
    run, known = _last(cell)
    remarked = []
    for now in found:
        changes = []
        for field, word in COMPARED.items():
            before, after = getattr(known.get(now.name), field, None), getattr(now, field)
            if before and before != after:
                changes.append(f"{word} {after or 'none'}, which was {before}")
        if changes:
            remark = f"since the run {run}: {', '.join(changes)}"
            remarked.append(replace(now, remark="; ".join(filter(None, (now.remark, remark)))))
        else:
            remarked.append(now)
    return tuple(remarked)


def _last(cell: Cell) -> tuple[str, dict[str, DeviceIdentity]]:
    """The name of the last run whose first event can be read, and the devices with which it began."""
    for run in reversed(run_folders(cell)):
        with suppress(OSError, HexacellError), run.journal.open("rb") as journal:
            entry = decode(journal.readline(), run.journal, 1)
            if entry is not None and isinstance(entry.event, events.RunStarted) and entry.event.devices:
                return run.name, {one.name: one for one in entry.event.devices}
    return "", {}
