"""The config formats ``json`` and ``yaml``: numbers at a place in a tree of tables and lists.

    [controller.config_options]
    names = { S = "legs.{index}.base.{component}", l = "legs.{index}.length" }

names the places of ``legs: [{base: {x: 1.0, ...}, length: 590.0}, ...]``; ``{axis}`` counts components from
0, for lists of three. A JSON text is read as YAML, of which it is a part but for its tabs.
"""

import json
import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate
from pathlib import Path
from typing import Any

from hexacell.config.interface import NumberToken, token_error
from hexacell.config.keyed_config import KeyedConfig, KeyedOptions, options_of
from hexacell.errors import FileError
from hexacell.kinematics.parameters import GeometricParameter, ParameterSet

_OCTAL = re.compile(r"[+-]?0+\d")
_MERGED = "tag:yaml.org,2002:merge"


class DataFile(KeyedConfig):
    """A :class:`~hexacell.config.interface.ConfigFormat`; raises ``UsageError`` for options."""

    FORMAT = "yaml"

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
    ) -> None:
        options = options_of(KeyedOptions, self.FORMAT, given)
        opened = partial(TreeText, self.FORMAT)
        super().__init__(parameters, options, _default, opened, is_part=is_part)


class JsonFile(DataFile):
    """The same of a JSON text."""

    FORMAT = "json"


def _default(parameter: GeometricParameter) -> str:
    """``S.0.x``, or ``l.0``."""
    return ".".join(filter(None, (parameter.kind.symbol, str(parameter.leg - 1), parameter.component)))


@dataclass(slots=True)
class _Value:
    token: NumberToken
    problem: str


@dataclass(frozen=True)
class TreeText:
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in such a text."""

    form: str
    text: str
    source: Path | None

    def number(self, key: str) -> NumberToken:
        """The number at a place.

        Raises:
            FileError: it is absent, text, or a number that others read otherwise; or it, or what it is in,
                is there twice or shared.
        """
        found: list[_Value] = []
        for place in accumulate(key.split("."), "{}.{}".format):
            found = self._places.get(place, [])
            problem = found[-1].problem if found else ""
            if len(found) > 1:
                problem = f"is there a second time, after line {found[0].token.line}"
            if problem:
                action = "Write one plain number there"
                raise token_error(found[-1].token, f"{place} {problem}", self.source, action)
        if not found:
            action = "Correct [controller.config_options], or name the file that has it"
            raise FileError(f"there is nothing at {key}", subject=self.source, action=action)
        return found[0].token

    def has(self, key: str) -> bool:
        """Whether there is something at a place."""
        return key in self._places

    @cached_property
    def _places(self) -> Mapping[str, list[_Value]]:
        import yaml  # noqa: PLC0415 - only for these formats

        text = self.text
        try:
            if self.form == "json":
                json.loads(text.removeprefix("\ufeff"))
                text = text.replace("\t", " ")  # outside of texts, in which JSON allows none
            root = yaml.compose(text, Loader=yaml.SafeLoader)
        except json.JSONDecodeError as error:
            raise self._unreadable(error.msg, error.lineno) from error
        except yaml.MarkedYAMLError as error:
            line = None if error.problem_mark is None else error.problem_mark.line + 1
            raise self._unreadable(error.problem or "it is no YAML", line) from error
        except (yaml.YAMLError, ValueError) as error:
            raise self._unreadable(str(error).splitlines()[0], None) from error
        except RecursionError as error:
            raise self._unreadable("it is nested too deeply", None) from error
        found: defaultdict[str, list[_Value]] = defaultdict(list)
        first, left = dict[int, _Value](), [] if root is None else [("", root)]
        while left:
            place, node = left.pop()
            value = _Value(self._token(node), _problem(node))
            found[place].append(value)
            if (shared := first.setdefault(id(node), value)) is not value:
                value.problem = shared.problem = "is used in more than one place, by an alias"
            else:
                left += [
                    (f"{place}.{name}".lstrip("."), child) for name, child in reversed(_children(node))
                ]
        return found

    def _token(self, node: Any) -> NumberToken:  # noqa: ANN401 - of a library without types
        start, end = node.start_mark.index, node.end_mark.index
        return NumberToken(self.text[start:end], start, end, node.start_mark.line + 1)

    def _unreadable(self, problem: str, line: int | None) -> FileError:
        return FileError(
            f"cannot be read as {self.form.upper()}: {problem}",
            subject=self.source,
            line=line,
            action="Correct it, or name another config_format",
        )


def _children(node: Any) -> list[tuple[str, Any]]:  # noqa: ANN401
    """What is in a list or a table, in its order; a merge key has nothing of its own."""
    if node.id == "sequence":
        return [(str(place), child) for place, child in enumerate(node.value)]
    pairs = node.value if node.id == "mapping" else ()
    return [(key.value, child) for key, child in pairs if key.id == "scalar" and key.tag != _MERGED]


def _problem(node: Any) -> str:  # noqa: ANN401
    """Why a single value is no number to be rewritten; empty if it is one."""
    if node.id != "scalar":
        return ""
    if node.style is not None:
        return "is text, not a number"
    return f"is {node.value}, which some read as an octal number" if _OCTAL.match(node.value) else ""
