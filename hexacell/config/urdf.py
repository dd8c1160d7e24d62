"""The config format ``urdf``: the origins of joints in a URDF or xacro file.

    [controller.config_options]
    names = { S = "base_joint_{leg}/{component}", l = "strut_{leg}/z" }

names x, y or z of ``<joint name="base_joint_1"><origin xyz="0.1 0.2 0.3"/></joint>``. Lengths are metres
unless ``unit_mm`` says otherwise. What xacro computes (``${...}``) has no number to be rewritten.
"""

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.parsers import expat

from hexacell.config.interface import NumberToken, token_error
from hexacell.config.keyed_config import KeyedConfig, KeyedOptions, options_of
from hexacell.errors import FileError
from hexacell.kinematics.parameters import GeometricParameter, ParameterSet

METRE_MM = 1000.0
_ORIGIN = re.compile(
    r"""<origin(?:\s+\w+\s*=\s*(?:"[^"]*"|'[^']*'))*?\s+xyz\s*=\s*["'](?P<xyz>[^"']*)["']"""
)
_COMPUTED = re.compile(r"\$\{[^}]*\}|\S+")
_COMPONENTS = "xyz"


class UrdfOptions(KeyedOptions):
    """Options of the format, whose unit is the metre."""

    unit_mm: float = METRE_MM


class UrdfOrigins(KeyedConfig):
    """A :class:`~hexacell.config.interface.ConfigFormat`; raises ``UsageError`` for options."""

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
    ) -> None:
        options = options_of(UrdfOptions, "urdf", given)
        super().__init__(parameters, options, _default, UrdfText, is_part=is_part)


def _default(parameter: GeometricParameter) -> str:
    """``S1/x``; of a length the z of its joint."""
    return f"{parameter.kind.symbol}{parameter.leg}/{parameter.component or 'z'}"


@dataclass(frozen=True)
class UrdfText:
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in such a text."""

    text: str
    source: Path | None

    def number(self, key: str) -> NumberToken:
        """One of the three numbers of a joint's origin.

        Raises:
            FileError: there is no such joint, or two, or its origin has not three numbers.
        """
        joint, _, component = key.rpartition("/")
        if not (origins := self._origins[joint]) or component not in _COMPONENTS:
            raise FileError(
                f"no joint has an origin {key}",
                subject=self.source,
                action="Correct [controller.config_options]: names of joints, and /x, /y or /z",
            )
        token = origins[-1]
        if len(origins) > 1:
            problem = f"the joint {joint} is there a second time, after line {origins[0].line}"
            raise token_error(token, problem, self.source, "Remove one")
        words = list(_COMPUTED.finditer(token.text))
        if len(words) != len(_COMPONENTS) or "&" in token.text:
            problem = f"the origin of {joint} has not three numbers: xyz is {token.text!r}"
            raise token_error(token, problem, self.source, 'Write three: xyz="0.1 0.2 0.3"')
        word = words[_COMPONENTS.index(component)]
        line = token.line + token.text.count("\n", 0, word.start())
        return NumberToken(word[0], token.start + word.start(), token.start + word.end(), line)

    def has(self, key: str) -> bool:
        """Whether there is a joint of that name, with an origin."""
        return bool(self._origins.get(key.rpartition("/")[0]))

    @cached_property
    def _origins(self) -> Mapping[str, list[NumberToken]]:
        """What ``xyz`` has of the origin of each joint, by the joint's name."""
        found: defaultdict[str, list[NumberToken]] = defaultdict(list)
        parser, data, open_elements = expat.ParserCreate(), self.text.encode(), list[tuple[str, str]]()

        def begin(element: str, attributes: Mapping[str, str]) -> None:
            above, joint = open_elements[-1] if open_elements else ("", "")
            open_elements.append((element, attributes.get("name", "")))
            if (above, element) != ("joint", "origin"):
                return
            start, line = len(data[: parser.CurrentByteIndex].decode()), parser.CurrentLineNumber
            if (origin := _ORIGIN.match(self.text, start)) is None:
                problem = f"the origin of the joint {joint} has no xyz"
                raise FileError(problem, subject=self.source, line=line, action='Write xyz="0 0 0"')
            first, end = origin.span("xyz")
            line += self.text.count("\n", start, first)
            found[joint].append(NumberToken(origin["xyz"], first, end, line))

        parser.StartElementHandler = begin
        parser.EndElementHandler = lambda _: open_elements.pop()
        try:
            parser.Parse(data, True)
        except expat.ExpatError as error:
            problem = f"cannot be read as XML: {expat.ErrorString(error.code)}"
            raise FileError(problem, subject=self.source, line=error.lineno, action="Correct it") from error
        return found
