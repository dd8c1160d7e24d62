"""The config format ``linuxcnc-ini``: variables of LinuxCNC's INI file, or of a file that it includes.

    [HEXAGLIDE]
    S1X = -400.0
    ...
    L6 = 700.0

HAL reads them by ``setp hexaglidekins.s1x [HEXAGLIDE]S1X``. Limits of joints and axes in the same file
(``[JOINT_0] MIN_LIMIT``, ``[AXIS_X] MAX_LIMIT``) hold as well, ``[JOINT_0] BACKLASH``, and ``PLAY1`` and
others of :mod:`~hexacell.config.linuxcnc_legs` in the section.

To what it sends a motor LinuxCNC adds half of the joint's ``BACKLASH`` while the joint moves up, takes as
much away while it moves down, and keeps it while the joint stands; what it reports is without that
(``motion/control.c``, ``compute_screw_comp``). A joint with a ``COMP_FILE`` does not use it.

LinuxCNC looks for a variable in the first section of that name alone and takes the first one there; names
are case-sensitive; what stands behind the number belongs to the value, comments too; a backslash at the end
of a line, even of a comment, makes the next one a part of it (seen with ``inivar`` of LinuxCNC 2.9). 2.10
also ignores blanks behind that backslash, a carriage return among them, and blanks within the brackets of a
section (``inifile.cc``). What one of them would not see, or see otherwise than a person, is refused.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

from pydantic import Field

from hexacell.cell.fields import LARGEST_NUMBER, Text
from hexacell.config import interface
from hexacell.config.keyed_config import KeyedOptions, options_of
from hexacell.config.linuxcnc_legs import LegCorrections
from hexacell.errors import FileError
from hexacell.kinematics.corrections import CorrectionKind, Corrections, Six
from hexacell.kinematics.parameters import CONSTRAINTS, ParameterSet
from hexacell.storage import atomic_files


class LinuxcncIniOptions(KeyedOptions):
    """Options of the format; ``section`` is where the variables without a section of their own are."""

    section: Text = Field("GEOMETRY", min_length=1)


class LinuxcncIni(LegCorrections):
    """A :class:`~hexacell.config.interface.ConfigFormat`; raises ``UsageError`` for options."""

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
    ) -> None:
        options = options_of(LinuxcncIniOptions, "linuxcnc-ini", given)
        super().__init__(
            parameters,
            options,
            lambda parameter: parameter.name.upper(),
            lambda text, path: IniText(text, path, options.section),
            is_part=is_part,
        )

    def read(self, text: str, source: Path | None) -> interface.ConfigPart:
        """As those of legs, with backlash and limits; raises ``FileError`` with the line."""
        part, ini = super().read(text, source), IniText(text, source, "")
        backlash = cast("Six", tuple(_backlash(ini, joint, self._unit_mm) for joint in JOINTS))
        has_place = all(ini.has_section(joint) and not ini.has(f"{joint}/{COMP_FILE}") for joint in JOINTS)
        holds = part.holds | ({CorrectionKind.BACKLASH} if has_place else set())
        corrections, limits = replace(part.corrections, backlash=backlash), limits_in(ini, self._unit_mm)
        return replace(part, limits=limits, corrections=corrections, holds=holds)

    def rewrite(
        self, text: str, values: Mapping[str, float], corrections: Corrections | None = None
    ) -> str:
        """As those of legs, with another backlash, if that is given.

        A variable that is absent becomes the last one of its section.
        """
        new = super().rewrite(text, values, corrections)
        for joint, wanted in zip(JOINTS, corrections.backlash if corrections else (), strict=False):
            new = _with_backlash(IniText(new, None, ""), joint, self._unit_mm, wanted)
        return new

    def _key_of_pin(self, pin: str) -> str:
        """``PLAY1`` for ``play.0``, ``WEIGHT_CENTRE_X`` for ``weight-centre.x``."""
        name, _, part = pin.upper().replace("-", "_").partition(".")
        return f"{name}{int(part) + 1}" if part.isdecimal() else f"{name}_{part}".rstrip("_")


SEPARATOR = "/"
"""Between a section and a variable in a key; without it the variable is in the section of the options."""

CONTINUED = "\\"
"""At the end of a line; before blanks LinuxCNC 2.9 takes it for a part of the value."""

_CONTINUATION = "the line before ends with a backslash and goes on in this one", "Remove the backslash"
_SECOND_SECTION = "it does not look into a second section of that name", "Move it to the first one"

_UNCLOSED = "the line that begins its section has no ']'", "Close it"
_BLANKS = "its section has blanks within the brackets", "Remove them"

# A line that begins with "[" ends the section before it, closed or not.
_SECTION = re.compile(r"[ \t]*\[(?P<name>[^\]\n]*)(?P<close>\])?")
# Whatever stands between the name and the first "=" LinuxCNC skips; without one it looks no further.
_VARIABLE = re.compile(
    r"[ \t]*(?P<name>[^=\s#;\[][^=\s]*)(?:[ \t][^=\n]*)?(?:=[ \t]*(?P<value>.*?))?[ \t\r]*(?:\n|\Z)"
)
INCLUDE = re.compile(r"(?m)^#INCLUDE[ \t]+(.*?)[ \t\r]*$")
_NUMBER_AND_MORE = re.compile(r"(?P<number>[-+.\deE]+)[ \t]+(?P<more>.+)")


@dataclass(frozen=True, slots=True)
class _Variable:
    """One that a person sees; ``hidden`` is why LinuxCNC does not, and what to do, if so."""

    section: str
    name: str
    token: interface.NumberToken
    hidden: tuple[str, str] | None


@dataclass(frozen=True)
class IniText:
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in an INI text."""

    text: str
    source: Path | None
    section: str

    def number(self, key: str) -> interface.NumberToken:
        """The value of ``VARIABLE``, or of ``SECTION/VARIABLE``.

        Raises:
            FileError: LinuxCNC does not find it, or it is there twice, or more than a number.
        """
        section, _, name = key.rpartition(SEPARATOR)
        section = section or self.section
        found = [one for one in self._variables if (one.section, one.name) == (section, name)]
        seen = [one.token for one in found if one.hidden is None]
        if not seen:
            raise self._missing(section, name, found)
        if len(seen) > 1:
            problem = f"[{section}] has {name} a second time; LinuxCNC takes the one of line {seen[0].line}"
            raise interface.token_error(seen[1], problem, self.source, "Remove one")
        if more := _NUMBER_AND_MORE.fullmatch(seen[0].text):
            problem = f"behind {name} stands {more['more']!r}, which LinuxCNC takes for a part of the value"
            raise interface.token_error(seen[0], problem, self.source, "Put it into a line of its own")
        return seen[0]

    def has(self, key: str) -> bool:
        """Whether there is such a variable, wherever."""
        section, _, name = key.rpartition(SEPARATOR)
        return any((one.section, one.name) == (section or self.section, name) for one in self._variables)

    def has_section(self, name: str) -> bool:
        """Whether there is such a section with a variable in it."""
        return any(one.section == name for one in self._variables)

    def with_variable(self, section: str, line: str) -> str:
        """The text with another line at the end of a section; raises ``FileError`` if there is none."""
        lines = [
            self.text[: self.text.find("\n", one.token.end) + 1 or len(self.text)]
            for one in self._variables
            if one.section == section and one.hidden is None
        ]
        # A line that ends with a backslash would swallow the next one.
        places = [first for first in lines if not first.rstrip().endswith(CONTINUED)]
        if not places:
            raise FileError(f"there is no section [{section}]", subject=self.source, action="Add it")
        first, end = places[-1], "\r\n" if "\r\n" in self.text else "\n"
        gap = "" if first.endswith("\n") else end
        return "".join((first, gap, line, end, self.text[len(first) :]))

    def _missing(self, section: str, name: str, found: list[_Variable]) -> FileError:
        for token, (why, action) in ((one.token, one.hidden) for one in found if one.hidden):
            problem = f"LinuxCNC does not see [{section}] {name}: {why}"
            return interface.token_error(token, problem, self.source, action)
        return FileError(
            f"there is no {name} in a section [{section}]",
            subject=self.source,
            action="Name the file that holds it, or correct [controller.config_options]",
        )

    @cached_property
    def _variables(self) -> tuple[_Variable, ...]:
        return tuple(self._each_variable())

    def _each_variable(self) -> Iterator[_Variable]:
        section, seen, start = "", set[str](), 0
        hidden_by_header: tuple[str, str] | None = None
        is_continued = False
        for line, content in enumerate(self.text.split("\n"), start=1):
            was_continued, is_continued = is_continued, content.rstrip(" \t\r").endswith(CONTINUED)
            if variable := _VARIABLE.fullmatch(content):
                group = "value" if variable["value"] is not None else "name"
                first, end = (start + place for place in variable.span(group))
                token = interface.NumberToken(variable[group], first, end, line)
                hidden = _CONTINUATION if was_continued else hidden_by_header
                yield _Variable(section, variable["name"], token, hidden)
            elif header := _SECTION.match(content):
                if was_continued:
                    problem = f"LinuxCNC may not see this section: {_CONTINUATION[0]}"
                    raise FileError(problem, subject=self.source, line=line, action="Remove the backslash")
                section, hidden_by_header = header["name"].strip(), _SECOND_SECTION
                if header["close"] is None:
                    hidden_by_header = _UNCLOSED
                elif section != header["name"]:
                    hidden_by_header = _BLANKS
                elif section not in seen:
                    hidden_by_header = None
                    seen.add(section)
            start += len(content) + 1


JOINTS = tuple(f"JOINT_{leg}" for leg in range(CONSTRAINTS))
BACKLASH, COMP_FILE = "BACKLASH", "COMP_FILE"
BACKLASH_DECIMALS = 6
"""1 nm."""


def _backlash(ini: IniText, joint: str, unit_mm: float) -> float:
    """The backlash that LinuxCNC uses of a joint, in mm or deg."""
    key = f"{joint}/{BACKLASH}"
    if not ini.has(key):
        return 0.0
    token = ini.number(key)
    value = interface.number_of(token, ini.source) * (1.0 if _turns(ini, joint) else unit_mm)
    if abs(value) > interface.LARGEST_BACKLASH:
        problem = f"{BACKLASH} of [{joint}] is {token.text}, more than a machine can have"
        raise interface.token_error(token, problem, ini.source, "Correct it")
    return 0.0 if ini.has(f"{joint}/{COMP_FILE}") else value


def _with_backlash(ini: IniText, joint: str, unit_mm: float, wanted: float) -> str:
    """The text with another backlash of a joint, if it is another by half of its last decimal."""
    if abs(wanted - _backlash(ini, joint, unit_mm)) <= 0.5 * 10.0**-BACKLASH_DECIMALS:
        return ini.text
    number = interface.write_number(wanted, BACKLASH_DECIMALS, 1.0 if _turns(ini, joint) else unit_mm)
    if ini.has(f"{joint}/{BACKLASH}"):
        return interface.replace_tokens(ini.text, {ini.number(f"{joint}/{BACKLASH}"): number})
    return ini.with_variable(joint, f"{BACKLASH} = {number}")


ROTARY_JOINT = "ANGULAR"
LIMITS = {"MIN_LIMIT": -1.0, "MAX_LIMIT": 1.0}
UNLIMITED: interface.Range = (-LARGEST_NUMBER, LARGEST_NUMBER)


def limits_of_ini(path: Path, unit_mm: float = 1.0) -> interface.ControllerLimits:
    """The limits in an INI file and in those that it includes, in mm and deg; None where none is stated.

    ``unit_mm`` is one unit of length of the machine; angles are in degrees on every machine.

    Raises:
        FileError: the file cannot be read, or a limit is no number, or not above the other.
    """
    text = atomic_files.read_text(path, interface.LARGEST_CONFIG_BYTES)
    found = limits_in(IniText(text, path, ""), unit_mm)
    for more in filter(Path.is_file, (path.parent / name for name in INCLUDE.findall(text))):
        included = IniText(atomic_files.read_text(more, interface.LARGEST_CONFIG_BYTES), more, "")
        found = found.narrowed(limits_in(included, unit_mm))
    return found


def limits_in(ini: IniText, unit_mm: float) -> interface.ControllerLimits:
    """The limits in a text; an absent one LinuxCNC takes for none."""
    joints = [_range(ini, section, 1.0 if _turns(ini, section) else unit_mm) for section in JOINTS]
    axes = [_range(ini, f"AXIS_{axis}", unit_mm if axis in "XYZ" else 1.0) for axis in "XYZABC"]
    return interface.ControllerLimits(
        joints=tuple(one or UNLIMITED for one in joints) if any(joints) else None,
        axes=tuple(axes) if any(axes) else None,
    )


def _turns(ini: IniText, joint: str) -> bool:
    """Whether a joint is one of angles; without ``TYPE`` LinuxCNC takes it for one of lengths."""
    key = f"{joint}/TYPE"
    return ini.has(key) and ini.number(key).text.upper() == ROTARY_JOINT


def _range(ini: IniText, section: str, unit: float) -> interface.Range | None:
    """Both limits of a joint or an axis; None if it has none."""
    low, high = (_limit(ini, f"{section}/{name}", sign) for name, sign in LIMITS.items())
    if low is None and high is None:
        return None
    lowest = UNLIMITED[0] if low is None else max(UNLIMITED[0], unit * float(low.text))
    highest = UNLIMITED[1] if high is None else min(UNLIMITED[1], unit * float(high.text))
    if low is not None and high is not None and lowest >= highest:
        problem = f"MAX_LIMIT of [{section}] is not above its MIN_LIMIT, {low.text}"
        raise interface.token_error(high, problem, ini.source, "Correct one of them")
    return lowest, highest


def _limit(ini: IniText, key: str, sign: float) -> interface.NumberToken | None:
    if not ini.has(key):
        return None
    token = ini.number(key)
    # LinuxCNC's own defaults are -1e99 and 1e99 (emccfg.h).
    if re.fullmatch(interface.NUMBER, token.text, re.ASCII) and sign * float(token.text) >= LARGEST_NUMBER:
        return None
    interface.number_of(token, ini.source)
    return token
