#!/usr/bin/python3
"""Memory of the simulated drives: drives.inc has where the motors are, which LinuxCNC reads as it starts.

A user-space component of LinuxCNC, for the Python of the system, for which LinuxCNC brings the module hal.
"""

import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import hal

MOTORS = range(1, 7)
PERIOD_S = 0.01
FILE, NEW_FILE = Path("drives.inc"), Path("drives.inc.new")
HEAD = "# Where the motors are, mm: simulated-drives.py keeps it here.\n[DRIVES]\n"


def write(places: Iterable[float]) -> None:
    """Replace the file in one step."""
    lines = [f"MOTOR{motor} = {place!r}\n" for motor, place in enumerate(places, start=1)]
    NEW_FILE.write_text(HEAD + "".join(lines))
    NEW_FILE.replace(FILE)


def follow(drives: hal.component) -> None:
    """Write every change of a place."""
    before: list[float] = []
    while True:
        now = [drives[f"motor-{motor}"] for motor in MOTORS]
        if before and now != before:
            write(now)
        before = now
        time.sleep(PERIOD_S)


component = hal.component("simulated-drives")
for number in MOTORS:
    component.newpin(f"motor-{number}", hal.HAL_FLOAT, hal.HAL_IN)
component.ready()
with suppress(KeyboardInterrupt):  # that is how LinuxCNC ends it
    follow(component)
