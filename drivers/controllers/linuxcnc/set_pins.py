"""``hexacell-set-pins``: a running LinuxCNC gets the geometry that its HAL and INI files have now.

    hexacell-set-pins hexaglide.hal geometry.inc

sets every pin again that a ``setp`` line of the HAL files sets to a variable of the INI files; if none is
named, every pin that such a line sets to a number. Other pins stay as they were tuned at run time.

It is the ``reload_command`` of a cell: the machine must be off, since with the machine on a new geometry
makes the joints jump (by 6.8 mm at 3.4 m/s in a trial).

The forward kinematics must then find a pose at the joints where they stand. If a pin ``*fwd-kins-fail``
says that it does not, the old values are set again and the command fails.
"""

import re
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from hexacell.config.linuxcnc_hal import SETP
from hexacell.config.linuxcnc_ini import IniText
from hexacell.errors import HexacellError, UsageError
from hexacell.storage.atomic_files import read_text

KINEMATICS_CYCLES_S = 0.1
"""A hundred cycles of the servo thread, in each of which the forward kinematics is computed."""

TIMEOUT_S = 10.0
FAILURE_PINS = "*fwd-kins-fail"

_REFERENCE = re.compile(r"\[(?P<section>[^\]]+)\](?P<name>\S+)")
_SHOWN = re.compile(r"\s*\S+\s+(?:float|bit|s32|u32)\s+\S+\s+(?P<value>\S+)\s+(?P<pin>\S+)")


def main() -> int:
    """Run the command; the exit status is 0, or 1 with one line that says why."""
    try:
        count = set_pins([Path(name) for name in sys.argv[1:]])
    except HexacellError as error:
        print(f"hexacell-set-pins: {error}", file=sys.stderr)  # noqa: T201 - a command of its own
        return 1
    print(f"{count} pins set")  # noqa: T201
    return 0


def set_pins(files: Sequence[Path], settle_s: float = KINEMATICS_CYCLES_S) -> int:
    """Set the pins of HAL files (``*.hal``) to the numbers in them and in the INI files; their number.

    After ``settle_s`` the forward kinematics has been computed with them.

    Raises:
        FileError: a file cannot be read, or has a section that a pin names, and not its variable.
        UsageError: there is no HAL file or no pin in it, LinuxCNC does not run here, or has no such pin; or
            its forward kinematics fails with these numbers.
    """
    hal = [path for path in files if path.suffix == ".hal"]
    if not hal:
        raise UsageError("no HAL file is named", action="hexacell-set-pins FILE.hal ... [FILE.ini ...]")
    inis = [path for path in files if path not in hal]
    wanted = dict(_wanted(hal, [IniText(read_text(path), path, "") for path in inis]))
    if not wanted:
        raise UsageError(
            "the HAL files set no pin to a number, or to a variable of these INI files",
            action="Name the files that have the geometry",
        )
    shown = _shown("*")
    if absent := sorted(wanted.keys() - shown.keys()):
        raise UsageError(
            f"the running LinuxCNC has no pin {absent[0]}",
            action="Start it with this configuration, or name its own HAL files",
        )
    # LinuxCNC shows seven digits of them, which is enough to go back while the machine is off.
    before = {pin: shown[pin] for pin in wanted}
    _set(wanted)
    time.sleep(settle_s)
    if failing := [pin for pin, value in _shown(FAILURE_PINS).items() if value == "TRUE"]:
        _set(before)
        raise UsageError(
            f"the forward kinematics finds no pose with these numbers ({failing[0]}); the old ones are set",
            action="Look at the new geometry; the machine is off",
        )
    return len(wanted)


def _wanted(hal: Iterable[Path], inis: Sequence[IniText]) -> Iterator[tuple[str, str]]:
    """Every pin with its value as text; of INI variables, those of sections that the INI files have.

    Where there are INI files, they have the geometry, and a number in the HAL file is not part of it.
    """
    for path in hal:
        for line in read_text(path).split("\n"):
            if setp := SETP.fullmatch(line):
                reference = _REFERENCE.fullmatch(setp["value"])
                if reference is None:
                    if not inis:
                        yield setp["pin"], setp["value"]
                elif with_it := [ini for ini in inis if ini.has_section(reference["section"])]:
                    number = with_it[0].number(f"{reference['section']}/{reference['name']}")
                    yield setp["pin"], number.text


def _shown(pattern: str) -> Mapping[str, str]:
    lines = _halcmd(["-s", "show", "pin", pattern]).splitlines()
    found = (_SHOWN.match(line) for line in lines)
    return {one["pin"]: one["value"] for one in found if one is not None}


def _set(values: Mapping[str, str]) -> None:
    _halcmd(["-f"], "".join(f"setp {pin} {value}\n" for pin, value in values.items()))


def _halcmd(arguments: Sequence[str], given: str = "") -> str:
    try:
        done = subprocess.run(  # noqa: S603 - LinuxCNC's own program
            ["halcmd", *arguments],  # noqa: S607 - wherever it is installed
            input=given,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise UsageError(
            f"halcmd cannot be run: {error}", action="Run this where LinuxCNC is installed and runs"
        ) from error
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise UsageError(
            f"halcmd failed: {said[-1] if said else done.returncode}",
            action="See that LinuxCNC runs here, and that you may talk to it",
        )
    return done.stdout


if __name__ == "__main__":
    sys.exit(main())
