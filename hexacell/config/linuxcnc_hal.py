"""The config format ``linuxcnc-hal``: pins that a HAL file sets to numbers, as of ``genhexkins``.

    setp genhexkins.base.0.x -22.950

Where the value is a variable of the INI file (``[GENHEXKINS]BASE0X``), that is the config.
:mod:`~hexacell.config.linuxcnc_legs` says which pins may be beside those of the geometry.

halcmd joins a line that ends with a backslash, none behind it, to the next before it looks for a comment,
and takes ``PIN = VALUE`` for ``setp PIN VALUE`` (``halcmd_main.c``, ``halcmd.c``).
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from pydantic import Field

from hexacell.cell.fields import Text
from hexacell.config.interface import NumberToken, token_error
from hexacell.config.keyed_config import KeyedOptions, options_of
from hexacell.config.linuxcnc_legs import LegCorrections
from hexacell.errors import FileError
from hexacell.kinematics.parameters import GeometricParameter, ParameterSet

_JOIN = "\\\n"
_LINE = re.compile(
    r"""(?P<code>(?:\\\n|[^#"'\n]|"(?:\\\n|[^"\n])*"|'(?:\\\n|[^'\n])*')*)"""
    r"(?P<comment>(?:\\\n|[^\n])*)(?:\n|\Z)"
)
_WORD = re.compile(r"(?!\\\n)\S(?:(?:\\\n)*(?!\\\n)\S)*")
_SWALLOWED = re.compile(r"\n[ \t]*(?:setp[ \t]|\S+[ \t]+=[ \t])")

VARIABLE = "["
"""Begins a variable of the INI file: ``[SECTION]NAME``."""


class HalPinsOptions(KeyedOptions):
    """Options of the format; ``component`` is that of the pins without a pattern of their own."""

    component: Text = Field("genhexkins", min_length=1)


class HalPins(LegCorrections):
    """A :class:`~hexacell.config.interface.ConfigFormat`; raises ``UsageError`` for options."""

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
    ) -> None:
        options = options_of(HalPinsOptions, "linuxcnc-hal", given)
        super().__init__(parameters, options, partial(_pin, options.component), HalText, is_part=is_part)
        self._component = options.component

    def _key_of_pin(self, pin: str) -> str:
        return f"{self._component}.{pin}"


def _pin(component: str, parameter: GeometricParameter) -> str:
    """``genhexkins.base.0.x``."""
    parts = (component, parameter.kind.symbol.lower(), str(parameter.leg - 1), parameter.component)
    return ".".join(filter(None, parts))


@dataclass(frozen=True)
class HalText:
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in a HAL text."""

    text: str
    source: Path | None

    def number(self, key: str) -> NumberToken:
        """What a pin is set to.

        Raises:
            FileError: it is not set, or twice, or to a variable of the INI file.
        """
        if not (tokens := self._tokens[key]):
            raise FileError(
                f"no line sets the pin {key}",
                subject=self.source,
                action="Correct [controller.config_options], or name the file that sets it",
            )
        if len(tokens) > 1:
            problem = f"{key} is set a second time, after line {tokens[0].line}"
            raise token_error(tokens[1], problem, self.source, "Remove one")
        if tokens[0].text.startswith(VARIABLE):
            problem = f"{key} is set to {tokens[0].text}, a variable of the INI file"
            action = 'Name the INI file as the config, with config_format = "linuxcnc-ini"'
            raise token_error(tokens[0], problem, self.source, action)
        return tokens[0]

    def has(self, key: str) -> bool:
        """Whether a line sets a pin to a number: to a variable of the INI file, it is that which has it."""
        return any(not token.text.startswith(VARIABLE) for token in self._tokens.get(key, ()))

    @property
    def pins(self) -> Iterator[tuple[str, NumberToken]]:
        """Each pin that is set, and to what; raises ``FileError`` where these are not one each."""
        for words in self.commands:
            is_assignment = len(words) == 3 and words[1].text == "="
            if words[0].text != "setp" and not is_assignment:
                continue
            value = words[-1]
            if len(words) != 3 or len(value.text) != value.end - value.start or value.text.endswith("\\"):
                problem = "this command does not set one pin to one value within a line"
                action = "Write setp PIN VALUE; only a backslash right before the line feed goes on"
                raise token_error(words[0], problem, self.source, action)
            yield words[0 if is_assignment else 1].text, value

    @property
    def commands(self) -> Iterator[tuple[NumberToken, ...]]:
        """The words of each command that halcmd sees; raises ``FileError`` where a comment hides one."""
        number = 1
        for line in _LINE.finditer(self.text):
            start, code = line.span("code")
            words = tuple(
                NumberToken(
                    word[0].replace(_JOIN, ""),
                    *word.span(),
                    number + self.text.count("\n", start, word.start()),
                )
                for word in _WORD.finditer(self.text, start, code)
            )
            if swallowed := _SWALLOWED.search(self.text, code, line.end()):
                problem = "LinuxCNC does not see this command: the comment before it ends with a backslash"
                at = number + self.text.count("\n", start, swallowed.start() + 1)
                raise FileError(problem, subject=self.source, line=at, action="Remove the backslash")
            if words:
                yield words
            number += line[0].count("\n")

    @cached_property
    def _tokens(self) -> Mapping[str, list[NumberToken]]:
        found: defaultdict[str, list[NumberToken]] = defaultdict(list)
        for pin, value in self.pins:
            found[pin].append(value)
        return found
