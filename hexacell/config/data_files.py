"""The config formats ``json`` and ``yaml``: numbers at a place in a tree of tables and lists.

    [controller.config_options]
    names = { S = "legs.{index}.base.{component}", l = "legs.{index}.length" }

names the places of ``legs: [{base: {x: 1.0, ...}, length: 590.0}, ...]``; ``{axis}`` counts components from
0, for lists of three. A JSON text is read as YAML, of which it is a part but for its tabs.
"""

import json
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from hexacell.config.interface import NumberToken, token_error
from hexacell.config.keyed_config import KeyedConfig, KeyedOptions, options_of
from hexacell.errors import FileError
from hexacell.kinematics.parameters import GeometricParameter, ParameterSet

_OCTAL = re.compile(r"[+-]?0\d")
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


@dataclass(frozen=True)
class TreeText:
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in such a text."""

    form: str
    text: str
    source: Path | None

    def number(self, key: str) -> NumberToken:
        """The number at a place.

        Raises:
            FileError: it is absent, there twice, shared, text, or a number that others read otherwise.
        """
        if not (found := self._places[key]):
            action = "Correct [controller.config_options], or name the file that has it"
            raise FileError(f"there is nothing at {key}", subject=self.source, action=action)
        token, problem = found[-1]
        if len(found) > 1:
            problem = f"{key} is there a second time, after line {found[0][0].line}"
        if (
            not problem
            and token.text.lstrip("+-").startswith("0")
            and token.text.lstrip("+-0")[:1].isdigit()
        ):
            problem = f"{token.text} at {key} begins with 0, as octal numbers do"
        if problem:
            raise token_error(token, problem, self.source, "Write one plain number there")
        return token

    def has(self, key: str) -> bool:
        """Whether there is something at a place."""
        return key in self._places

    @cached_property
    def _places(self) -> Mapping[str, list[tuple[NumberToken, str]]]:
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
        found: defaultdict[str, list[tuple[NumberToken, str]]] = defaultdict(list)
        for place, token, problem in self._scalars(root, (), set()):
            found[place].append((token, problem))
        return found

    def _scalars(
        self,
        node: Any,  # noqa: ANN401 - of a library without types
        place: tuple[str, ...],
        seen: set[int],
    ) -> Iterator[tuple[str, NumberToken, str]]:
        """Each single value with its place, and why it cannot be rewritten; empty if it can."""
        if node is None:
            return
        if isinstance(node.value, str):
            token = NumberToken(
                self.text[node.start_mark.index : node.end_mark.index],
                node.start_mark.index,
                node.end_mark.index,
                node.start_mark.line + 1,
            )
            name, problem = ".".join(place), ""
            if id(node) in seen:
                problem = f"{name} is an alias: what is written there is used elsewhere too"
            elif node.style is not None:
                problem = f"{name} is text, not a number"
            yield name, token, problem
        elif id(node) not in seen:
            pairs = enumerate(node.value) if node.id == "sequence" else node.value
            for key, value in pairs:
                if isinstance(key, int):
                    yield from self._scalars(value, (*place, str(key)), seen)
                elif key.tag != _MERGED and isinstance(key.value, str):
                    yield from self._scalars(value, (*place, key.value), seen)
        seen.add(id(node))

    def _unreadable(self, problem: str, line: int | None) -> FileError:
        return FileError(
            f"cannot be read as {self.form.upper()}: {problem}",
            subject=self.source,
            line=line,
            action="Correct it, or name another config_format",
        )
