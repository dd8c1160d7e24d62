"""``hexacell-set-pins``: a running LinuxCNC gets the geometry that its HAL and INI files have now.

    hexacell-set-pins hexaglide.hal geometry.inc

sets every pin again that a ``setp`` line of the HAL files sets to a variable of the INI files; if none is
named, every pin that such a line sets to a number. Other pins stay as they were tuned at run time. Where it
cannot tell which number a pin is to have, nothing is set.

It is the ``reload_command`` of a cell: the machine must be off, since with the machine on a new geometry
makes the joints jump (by 6.8 mm at 3.4 m/s in a trial).

The forward kinematics must then find a pose at the joints where they stand. If a pin ``*fwd-kins-fail``
says that it does not, the old values are set again and the command fails.
"""

import re
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from hexacell.config.interface import NUMBER, NumberToken, token_error
from hexacell.config.linuxcnc_hal import HalText
from hexacell.config.linuxcnc_ini import INCLUDE, IniText
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.printable import printable
from hexacell.storage.atomic_files import read_text

KINEMATICS_CYCLES_S = 0.1
"""A hundred cycles of the servo thread, in each of which the forward kinematics is computed."""

TIMEOUT_S = 10.0
FAILURE_PINS = "*fwd-kins-fail"

_VARIABLE = re.compile(r"\[([^\]]+)\](?:([\w.-]+)|\(([^)]+)\))", re.ASCII)
_PUT_TOGETHER = re.compile(r"[\[$\"']")
_VALUE = re.compile(rf"{NUMBER}|0[xX][\da-fA-F]+|(?i:true|false)", re.ASCII)

_LINKS = frozenset({"net", "linksp", "linkps"})
_OF_HALCMD = re.compile(
    "[sg]etp|[sg]ets|[ps]type|newsig|delsig|net|link(?:pp|ps|sp)|unlinkp|addf|delf|start|stop|(?:un)?load.*|"
    "waitusr|source|(?:un)?alias|(?:un)?lock|(?:un)?echo|show|list|save|status|print|debug|help|quit|exit"
)

_SHOWN = re.compile(r"\s*\S+\s+(?:float|bit|[su](?:32|64))\s+\S+\s+(?P<value>\S+)\s+(?P<pin>\S+)")


def main() -> int:
    """Run the command; the exit status is 0, or 1 with one line that says why."""
    try:
        count = set_pins([Path(name) for name in sys.argv[1:]])
    except HexacellError as error:
        print(printable(f"hexacell-set-pins: {error}"), file=sys.stderr)  # noqa: T201 - a command of its own
        return 1
    print(f"{count} pins set")  # noqa: T201
    return 0


def set_pins(files: Sequence[Path], settle_s: float = KINEMATICS_CYCLES_S) -> int:
    """Set the pins of HAL files (``*.hal``) to the numbers in them and in the INI files; their number.

    After ``settle_s`` the forward kinematics has been computed with them.

    Raises:
        FileError: a file cannot be read, has a section that a pin names, and not its variable, or a line
            that is not understood and may set a pin; or no line uses a section of it.
        UsageError: there is no HAL file or no pin in it, LinuxCNC does not run here, or has no such pin; or
            its forward kinematics fails with these numbers.
    """
    hal = [path for path in files if path.suffix == ".hal"]
    if not hal:
        raise UsageError("no HAL file is named", action="hexacell-set-pins FILE.hal ... [FILE.ini ...]")
    inis = [path for path in files if path not in hal]
    wanted = _wanted(hal, [_with_includes_named(path, inis) for path in inis])
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
    try:
        _set(wanted)
    except UsageError:
        # halcmd ends at the first pin that it cannot set, so this sets those before it again.
        with suppress(UsageError):
            _set(before)
        raise
    time.sleep(settle_s)
    if failing := [pin for pin, value in _shown(FAILURE_PINS).items() if value == "TRUE"]:
        _set(before)
        raise UsageError(
            f"the forward kinematics finds no pose with these numbers ({failing[0]}); the old ones are set",
            action="Look at the new geometry; the machine is off",
        )
    return len(wanted)


def _with_includes_named(path: Path, inis: Sequence[Path]) -> IniText:
    """An INI file; raises ``FileError`` where it includes another one that is not named."""
    text = read_text(path)
    for found in INCLUDE.finditer(text):
        if Path(found[1]).name not in {ini.name for ini in inis}:
            line = text.count("\n", 0, found.start()) + 1
            action = "Name it too: it may have the numbers"
            raise FileError(f"{found[1]} is included here", subject=path, line=line, action=action)
    return IniText(text, path, "")


def _wanted(hal: Sequence[Path], inis: Sequence[IniText]) -> Mapping[str, str]:
    """Every pin with its value as text; of INI variables, those of sections that the INI files have.

    Where there are INI files, they have the geometry, and a number in the HAL file is not part of it.
    """
    found, used = dict[str, str | None](), set[Path | None]()
    for text in (HalText(read_text(path), path) for path in hal):
        _require_no_other_way(text, hal, inis)
        for pin, value in text.pins:
            number = _filled(value, inis, text.source, used)
            if pin in found and (number or found[pin]):
                raise token_error(value, f"{pin} is set a second time", text.source, "Remove one")
            found[pin] = number
    wanted = {pin: number for pin, number in found.items() if number is not None}
    if unused := [ini.source for ini in inis if wanted and ini.source not in used]:
        action = "Leave it out, or set its pins in a HAL file"
        raise FileError("no line sets a pin to a variable of it", subject=unused[0], action=action)
    return wanted


def _filled(
    value: NumberToken, inis: Sequence[IniText], source: Path | None, used: set[Path | None]
) -> str | None:
    """What a pin is to get, None if that is not part of the geometry; ``used`` gets the INI files of it."""
    number, own = value.text, list(_of_files(value, inis))
    for variable, ini in own:
        token = ini.number(f"{variable[1]}/{variable[2] or variable[3]}")
        if not _VALUE.fullmatch(token.text):
            problem, action = (
                f"{variable[0]} is {token.text!r}, which is no number",
                "Write one, in this line",
            )
            raise token_error(token, problem, ini.source, action)
        number = number.replace(variable[0], token.text)
        used.add(ini.source)
    is_wanted = bool(own) if inis else _VARIABLE.search(number) is None
    if _PUT_TOGETHER.search(_VARIABLE.sub("", number)) or (is_wanted and not _VALUE.fullmatch(number)):
        problem = f"{value.text} is no number and no variable that these INI files have"
        raise token_error(value, problem, source, "Write it as [SECTION]NAME, [SECTION](NAME) or a number")
    return number if is_wanted else None


def _of_files(word: NumberToken, inis: Sequence[IniText]) -> Iterator[tuple[re.Match[str], IniText]]:
    """The variables in a word of which an INI file has the section, each with that file."""
    for found in _VARIABLE.finditer(word.text):
        having = [ini for ini in inis if ini.has_section(found[1])]
        if len(having) > 1:
            problem = f"it has a section [{found[1]}], as {having[0].source} has"
            raise FileError(problem, subject=having[1].source, action="Have it in one of them")
        yield from [(found, ini) for ini in having]


def _require_no_other_way(text: HalText, hal: Sequence[Path], inis: Sequence[IniText]) -> None:
    """Raise ``FileError`` where numbers reach LinuxCNC by more than the files' ``setp`` lines."""
    parts = {pin.partition(".")[0] for pin, _ in text.pins}
    # Without INI files the numbers in the HAL file are the geometry, those of signals at its pins too.
    signals = {
        word.text
        for command, *words in text.commands
        if command.text in _LINKS and any(word.text.partition(".")[0] in parts for word in words)
        for word in words
    }
    for command, *words in text.commands:
        is_named = {path.name for path in hal} & {Path(word.text).name for word in words}
        is_of_signal = any(list(_of_files(word, inis)) for word in words)
        is_of_signal |= not inis and bool(words) and words[0].text in signals
        if (command.text == "source" and not is_named) or (command.text == "sets" and is_of_signal):
            problem = f"{command.text} {' '.join(word.text for word in words)} may set pins too"
            raise token_error(command, problem, text.source, "Name the file too, or set the pin by setp")
        if not _OF_HALCMD.fullmatch(command.text) and [word.text for word in words[:1]] != ["="]:
            problem = f"{command.text!r} is no command of halcmd, and might set a pin"
            raise token_error(command, problem, text.source, "Write setp PIN VALUE, with blanks between")


def _shown(pattern: str) -> Mapping[str, str]:
    found = (_SHOWN.match(line) for line in _halcmd(["-s", "show", "pin", pattern]).splitlines())
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
