"""The config format ``urdf``: the origins of joints in a URDF or xacro file.

    [controller.config_options]
    names = { S = "base_joint_{leg}/{component}", l = "strut_{leg}/z" }

names x, y or z of ``<joint name="base_joint_1"><origin xyz="0.1 0.2 0.3"/></joint>``; ``/roll``, ``/pitch``
and ``/yaw`` are those of ``rpy``. Lengths are metres unless ``unit_mm`` says otherwise, angles rad. What
xacro computes (``${...}``) has no number to be rewritten.
"""

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import degrees
from pathlib import Path
from typing import Any
from xml.parsers import expat

from hexacell.cell.fields import Positive
from hexacell.config.interface import NumberToken, token_error
from hexacell.config.keyed_config import KeyedConfig, KeyedOptions, options_of
from hexacell.errors import FileError
from hexacell.kinematics.parameters import GeometricParameter, ParameterSet, ParameterUnit

METRE_MM = 1000.0
_TAG, _ATTRIBUTE = "<origin", re.compile(r"""\s+([^\s=]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_COMPUTED = re.compile(r"(?:\$\{[^}]*\}|\$\([^)]*\)|\S)+")
_PLACES = {
    part: (name, place)
    for name, parts in {"xyz": ("x", "y", "z"), "rpy": ("roll", "pitch", "yaw")}.items()
    for place, part in enumerate(parts)
}
_NOT_ALWAYS_ONCE = frozenset({"xacro:macro", "xacro:if", "xacro:unless"})


class UrdfOptions(KeyedOptions):
    """Options of the format, whose unit is the metre."""

    unit_mm: Positive = METRE_MM


class UrdfOrigins(KeyedConfig):
    """A :class:`~hexacell.config.interface.ConfigFormat`; raises ``UsageError`` for options."""

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
    ) -> None:
        options = options_of(UrdfOptions, "urdf", given)
        super().__init__(parameters, options, _default, UrdfText, is_part=is_part)

    def _unit(self, parameter: GeometricParameter) -> float:
        return degrees(1.0) if parameter.kind.unit is ParameterUnit.DEG else super()._unit(parameter)


def _default(parameter: GeometricParameter) -> str:
    """``S1/x``; of a length the z of its joint."""
    return f"{parameter.kind.symbol}{parameter.leg}/{parameter.component or 'z'}"


@dataclass(frozen=True)
class UrdfText:
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in such a text."""

    text: str
    source: Path | None

    def number(self, key: str) -> NumberToken:
        """One of the numbers of a joint's origin.

        Raises:
            FileError: there is no such joint, or two, it may be there more than once or not, or its origin
                has not three numbers.
        """
        if not (origins := self._origins.get(_attribute(key), [])):
            raise FileError(
                f"no joint has an origin {key}",
                subject=self.source,
                action="Correct [controller.config_options]: names of joints, and /x, /y, /z, /roll, ...",
            )
        token, above = origins[-1]
        joint, attribute = _attribute(key)
        if len(origins) > 1:
            problem = f"the joint {joint} is there a second time, after line {origins[0][0].line}"
            raise token_error(token, problem, self.source, "Remove one")
        if above:
            problem = f"the joint {joint} is inside <{above}>, and may be there more than once, or not"
            raise token_error(token, problem, self.source, "Write it outside")
        words = list(_COMPUTED.finditer(token.text))
        if len(words) != 3 or "&" in token.text:
            problem = f"the origin of {joint} has not three numbers: {attribute} is {token.text!r}"
            raise token_error(token, problem, self.source, f'Write three: {attribute}="0.1 0.2 0.3"')
        word = words[_PLACES[key.rpartition("/")[2]][1]]
        line = token.line + token.text.count("\n", 0, word.start())
        return NumberToken(word[0], token.start + word.start(), token.start + word.end(), line)

    def has(self, key: str) -> bool:
        """Whether there is a joint of that name, with such an origin."""
        return _attribute(key) in self._origins

    @cached_property
    def _origins(self) -> Mapping[tuple[str, str], list[tuple[NumberToken, str]]]:
        """What the origins have, by joint and attribute; each with what makes it uncertain, if anything."""
        found: defaultdict[tuple[str, str], list[tuple[NumberToken, str]]] = defaultdict(list)
        parser, data = expat.ParserCreate("utf-8"), self.text.encode()
        open_elements = list[tuple[str, str]]()

        def begin(element: str, attributes: Mapping[str, str]) -> None:
            above, joint = open_elements[-1] if open_elements else ("", "")
            open_elements.append((element, attributes.get("name", "")))
            if (above, element) != ("joint", "origin"):
                return
            place = len(data[: parser.CurrentByteIndex].decode()) + len(_TAG)
            uncertain = next((one for one, _ in open_elements if one in _NOT_ALWAYS_ONCE), "")
            while (match := _ATTRIBUTE.match(self.text, place)) is not None:
                place, (first, end) = match.end(), match.span(2 if match[3] is None else 3)
                line = self.text.count("\n", 0, first) + 1
                token = NumberToken(self.text[first:end], first, end, line)
                found[joint, match[1]].append((token, uncertain))

        def refuse(*_: object) -> None:
            line = parser.CurrentLineNumber
            raise FileError(
                "a URDF file has no DOCTYPE", subject=self.source, line=line, action="Remove it"
            )

        parser.StartElementHandler, parser.StartDoctypeDeclHandler = begin, refuse
        parser.EndElementHandler = lambda _: open_elements.pop()
        try:
            parser.Parse(data, True)
        except expat.ExpatError as error:
            problem = f"cannot be read as XML: {expat.ErrorString(error.code)}"
            raise FileError(problem, subject=self.source, line=error.lineno, action="Correct it") from error
        return found


def _attribute(key: str) -> tuple[str, str]:
    """The joint, and the attribute of its origin that has a number."""
    joint, _, part = key.rpartition("/")
    return joint, _PLACES.get(part, ("", 0))[0]
