"""The text of a LinuxCNC INI file, as LinuxCNC reads it.

LinuxCNC looks for a variable in the first section of that name alone and takes the first one there; names
are case-sensitive; what stands behind the number belongs to the value, comments too; a backslash at the end
of a line, even of a comment, makes the next one a part of it (seen with ``inivar`` of LinuxCNC 2.9). What
LinuxCNC would not see, or see otherwise than a person, is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hexacell.config.number_tokens import NumberToken
from hexacell.errors import FileError

SEPARATOR = "/"
"""Between a section and a variable in a key; without it the variable is in the section of the options."""

CONTINUED = "\\"
"""At the end of a line; before a carriage return LinuxCNC takes it for a part of the value."""

_CONTINUATION = "the line before ends with a backslash and goes on in this one", "Remove the backslash"
_SECOND_SECTION = "it does not look into a second section of that name", "Move it to the first one"

_UNCLOSED = "the line that begins its section has no ']'", "Close it"

# A line that begins with "[" ends the section before it, closed or not.
_SECTION = re.compile(r"[ \t]*\[(?P<name>[^\]\n]*)(?P<close>\])?")
# Whatever stands between the name and the first "=" LinuxCNC skips; without one it looks no further.
_VARIABLE = re.compile(
    r"[ \t]*(?P<name>[^=\s#;\[][^=\s]*)(?:[ \t][^=\n]*)?(?:=[ \t]*(?P<value>.*?))?[ \t\r]*(?:\n|\Z)"
)
_NUMBER_AND_MORE = re.compile(r"(?P<number>[-+.\deE]+)[ \t]+(?P<more>.+)")


@dataclass(frozen=True, slots=True)
class _Variable:
    """One that a person sees; ``hidden`` is why LinuxCNC does not, and what to do, if so."""

    section: str
    name: str
    token: NumberToken
    hidden: tuple[str, str] | None


@dataclass(frozen=True)
class IniText:
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in an INI text."""

    text: str
    source: Path | None
    section: str

    def number(self, key: str) -> NumberToken:
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
            raise self._error(
                seen[1],
                f"[{section}] has {name} a second time; LinuxCNC takes the one of line {seen[0].line}",
                "Remove one",
            )
        if more := _NUMBER_AND_MORE.fullmatch(seen[0].text):
            raise self._error(
                seen[0],
                f"behind {name} stands {more['more']!r}, which LinuxCNC takes for a part of the value",
                "Put it into a line of its own",
            )
        return seen[0]

    def has(self, key: str) -> bool:
        """Whether there is such a variable, wherever."""
        section, _, name = key.rpartition(SEPARATOR)
        return any((one.section, one.name) == (section or self.section, name) for one in self._variables)

    def has_section(self, name: str) -> bool:
        """Whether there is such a section with a variable in it."""
        return any(one.section == name for one in self._variables)

    def _missing(self, section: str, name: str, found: list[_Variable]) -> FileError:
        for one in found:
            if one.hidden is not None:
                problem, action = one.hidden
                return self._error(
                    one.token, f"LinuxCNC does not see [{section}] {name}: {problem}", action
                )
        return FileError(
            f"there is no {name} in a section [{section}]",
            subject=self.source,
            action="Name the file that holds it, or correct [controller.config_options]",
        )

    def _error(self, token: NumberToken, problem: str, action: str) -> FileError:
        return FileError(problem, subject=self.source, line=token.line, action=action)

    @cached_property
    def _variables(self) -> tuple[_Variable, ...]:
        return tuple(self._each_variable())

    def _each_variable(self) -> Iterator[_Variable]:
        section, seen, start = "", set[str](), 0
        hidden_by_header: tuple[str, str] | None = None
        is_continued = False
        for line, content in enumerate(self.text.split("\n"), start=1):
            was_continued, is_continued = is_continued, content.endswith(CONTINUED)
            if variable := _VARIABLE.fullmatch(content):
                group = "value" if variable["value"] is not None else "name"
                first, end = (start + place for place in variable.span(group))
                token = NumberToken(variable[group], first, end, line)
                hidden = _CONTINUATION if was_continued else hidden_by_header
                yield _Variable(section, variable["name"], token, hidden)
            elif (header := _SECTION.match(content)) and not was_continued:
                section, hidden_by_header = header["name"], _SECOND_SECTION
                if header["close"] is None:
                    section, hidden_by_header = section.strip(), _UNCLOSED
                elif section not in seen:
                    hidden_by_header = None
                    seen.add(section)
            start += len(content) + 1
