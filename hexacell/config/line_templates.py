"""The config format ``template``: lines of any text config, as the cell file shows them.

For a controller whose config is not known here. Each line is given once, with names of parameters in the
places of their numbers:

    [controller.config_options]
    lines = [
        "JOINT[{leg}] := ({S.x}, {S.y}, {S.z});",
        "ROD[{leg}] := {l};   SIGN[{leg}] := {branch};",
    ]

``{leg}``, counted from 1, and ``{index}``, from 0, make it six lines; ``{S3x}`` is the number of one leg.
Blanks in a template stand for any blanks, two braces for one. Each line must be in the config once.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Formatter
from typing import Any

from pydantic import Field

from hexacell.cell.fields import Text
from hexacell.config.interface import NUMBER, NumberToken
from hexacell.config.keyed_config import KeyedConfig, KeyedOptions, options_of
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.parameters import ParameterSet

BRANCH = "branch"
_LEG = {"leg", "index", BRANCH}


class LineTemplatesOptions(KeyedOptions):
    """Options of the format: the lines. A branch that is in none of them is given as six signs."""

    lines: tuple[Text, ...] = Field(min_length=1)


class LineTemplates(KeyedConfig):
    """A :class:`~hexacell.config.interface.ConfigFormat`; raises ``UsageError`` for options."""

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
    ) -> None:
        options = options_of(LineTemplatesOptions, "template", given)
        if options.names or options.corrections:
            raise UsageError(
                "config_options: names and corrections are for other formats than 'template'",
                action="Put the names of the parameters into the lines",
            )
        templates = tuple(_templates(parameters, options.lines))
        names = Counter(name for template in templates for name in template.names)
        if options.branch is None and f"{BRANCH}1" in names:
            options = options.model_copy(update={"branch": f"{BRANCH}{{leg}}"})
        super().__init__(
            parameters,
            options,
            lambda parameter: parameter.name,
            lambda text, path: _matched(text, path, templates),
            is_part=is_part,
        )
        for name in parameters.names:
            if names[name] > 1 or not (names[name] or is_part):
                often = "in no line" if not names[name] else "in more than one line"
                raise UsageError(f"config_options: {name} is {often}", action="Put it into one")


@dataclass(frozen=True, slots=True)
class _LineTemplate:
    """One line: how it is written in the cell file, and what it matches, with a group for each number."""

    shown: str
    pattern: re.Pattern[str]
    names: tuple[str, ...]


def _templates(parameters: ParameterSet, lines: Iterable[str]) -> Iterator[_LineTemplate]:
    of_a_leg = {f"{one.kind.symbol}.{one.component}".rstrip(".") for one in parameters.parameters} | _LEG
    for line in lines:
        fields = {field for _, field in _parsed(line) if field is not None}
        if unknown := sorted(fields - of_a_leg - {*parameters.names}):
            problem = f"config_options: {line!r} has {{{unknown[0]}}}, which is no parameter"
            raise UsageError(problem, action=f"A leg has {', '.join(sorted(of_a_leg))}")
        for leg in range(1, parameters.legs + 1) if fields & of_a_leg else (1,):
            yield _template(line, leg, of_a_leg)


def _parsed(line: str) -> list[tuple[str, str | None]]:
    """Literal texts, each with the name behind it, if any."""
    try:
        return [(text, field) for text, field, *_ in Formatter().parse(line)]
    except ValueError as error:
        raise UsageError(
            f"config_options: {line!r} is not a line template: {error}",
            action="Put names into braces; write a brace of the config as two",
        ) from error


def _template(line: str, leg: int, of_a_leg: set[str]) -> _LineTemplate:
    pattern, names = "", list[str]()
    for text, field in _parsed(line):
        pattern += r"\s+".join(re.escape(part) for part in re.split(r"\s+", text))
        if field in {"leg", "index"}:
            pattern += str(leg if field == "leg" else leg - 1)
        elif field is not None:
            symbol, _, component = field.partition(".")
            names.append(f"{symbol}{leg}{component}" if field in of_a_leg else field)
            pattern += f"({NUMBER})"
    return _LineTemplate(f"{line} (leg {leg})", re.compile(rf"\s*{pattern}\s*", re.ASCII), tuple(names))


class _MatchedLines(dict[str, NumberToken]):
    """A :class:`~hexacell.config.keyed_config.NumberLookup` in the lines that match."""

    number, has = dict.__getitem__, dict.__contains__


def _matched(text: str, source: Path | None, templates: Iterable[_LineTemplate]) -> _MatchedLines:
    """Find every template; raises ``FileError`` where a line is absent, or there twice."""
    lines, start, found = list[tuple[int, int, str]](), 0, _MatchedLines()
    for number, line in enumerate(text.split("\n"), start=1):
        lines.append((number, start, line))
        start += len(line) + 1
    for template in templates:
        found |= _tokens(template, lines, source)
    return found


def _tokens(
    template: _LineTemplate, lines: Iterable[tuple[int, int, str]], source: Path | None
) -> dict[str, NumberToken]:
    found = [(n, start, match) for n, start, line in lines if (match := template.pattern.fullmatch(line))]
    if not found:
        raise FileError(
            f"no line is like {template.shown}",
            subject=source,
            action="Correct the config, or lines in [controller.config_options]",
        )
    if len(found) > 1:
        problem = f"a second line, after line {found[0][0]}, is like {template.shown}"
        action = "Make the template differ from it"
        raise FileError(problem, subject=source, line=found[1][0], action=action)
    line, start, match = found[0]
    return {
        name: NumberToken(match[group], start + match.start(group), start + match.end(group), line)
        for group, name in enumerate(template.names, start=1)
    }
