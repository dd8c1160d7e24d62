"""The config format ``linuxcnc-hal``: pins that a HAL file sets to numbers, as of ``genhexkins``.

    setp genhexkins.base.0.x -22.950

Where the value is a variable of the INI file (``[GENHEXKINS]BASE0X``), that is the config.
:mod:`~hexacell.config.linuxcnc_legs` says which pins may be beside those of the geometry.
"""

import re
from collections import defaultdict
from collections.abc import Mapping
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

SETP = re.compile(r"[ \t]*setp[ \t]+(?P<pin>\S+)[ \t]+(?P<value>\S+)[ \t]*(?:#.*)?\r?")
"""A line that sets a pin."""

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
        tokens = self._tokens[key]
        if not tokens:
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

    @cached_property
    def _tokens(self) -> Mapping[str, list[NumberToken]]:
        found: defaultdict[str, list[NumberToken]] = defaultdict(list)
        start = 0
        for line, content in enumerate(self.text.split("\n"), start=1):
            if setp := SETP.fullmatch(content):
                first, end = (start + place for place in setp.span("value"))
                found[setp["pin"]].append(NumberToken(setp["value"], first, end, line))
            start += len(content) + 1
        return found
