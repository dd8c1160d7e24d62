"""A config with one number a key: what LinuxCNC's files and the templates of other controllers share.

Which key holds which number follows from patterns in the cell file, one for each kind of parameter:

    [controller.config_options]
    names = { S = "S{leg}{COMPONENT}", l = "L{leg}" }
    corrections = { S = "DS{leg}{COMPONENT}" }
    branch = "BRANCH{leg}"
    unit_mm = 25.4

``{leg}`` counts from 1, ``{index}`` from 0. Where ``corrections`` are named, the parameter is the sum of
both numbers, and only the correction is written: the nominal number stays as it is.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

from pydantic import Field, ValidationError

from hexacell.cell.fields import Positive, Section, Text, first_mistake
from hexacell.config import interface
from hexacell.errors import UsageError
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.parameters import GeometricParameter, ParameterSet, ParameterUnit

Options = TypeVar("Options", bound=Section)


class NumberLookup(Protocol):
    """The numbers of one text by their keys."""

    def number(self, key: str) -> interface.NumberToken:
        """The number of a key; raises ``FileError`` if there is none, or more than one."""

    def has(self, key: str) -> bool:
        """Whether there is a number of that key."""


OpenText = Callable[[str, Path | None], NumberLookup]
DefaultKey = Callable[[GeometricParameter], str]


class KeyedOptions(Section):
    """Where a config holds its numbers.

    Attributes:
        names: pattern of the key of each kind of parameter, by its symbol.
        corrections: the same, of numbers that are added.
        branch: pattern of the keys of the six signs, or the signs themselves.
        unit_mm: one unit of length in the config.
    """

    names: Mapping[str, Text] = Field(default_factory=dict)
    corrections: Mapping[str, Text] = Field(default_factory=dict)
    branch: Text | tuple[int, int, int, int, int, int] | None = None
    unit_mm: Positive = 1.0


def options_of(model: type[Options], format_name: str, given: Mapping[str, Any]) -> Options:
    """The options of a format, checked; raises ``UsageError``."""
    try:
        return model.model_validate(given)
    except ValidationError as error:
        raise UsageError(
            f"config_options of the config format '{format_name}': {first_mistake(error, 'they')}",
            action="Correct [controller.config_options] in the cell file",
        ) from error


def _filled(pattern: str, values: Mapping[str, str | int]) -> str:
    try:
        return pattern.format_map(values)
    except (KeyError, IndexError, ValueError, AttributeError) as error:
        raise UsageError(
            f"config_options: {pattern!r} is not a pattern of names",
            action="It may contain {leg}, {index}, {symbol}, {component}, {COMPONENT} and {axis}",
        ) from error


def _keys_by(patterns: Mapping[str, str], every: Iterable[GeometricParameter]) -> dict[str, str]:
    """The keys of the parameters whose kind has a pattern."""
    return {
        one.name: _filled(
            patterns[one.kind.symbol],
            {
                "symbol": one.kind.symbol,
                "leg": one.leg,
                "index": one.leg - 1,
                "component": one.component,
                "COMPONENT": one.component.upper(),
                "axis": "xyz".find(one.component),
            },
        )
        for one in every
        if one.kind.symbol in patterns
    }


def _branch_of(parameters: ParameterSet, options: KeyedOptions) -> tuple[str, ...] | Branch:
    given = options.branch
    if not parameters.has_branch:
        return ()
    if given is None:
        raise UsageError(
            "config_options have no branch, and a leg of this mechanism has two inverse solutions",
            action="Name the config's signs there, or give them: branch = [1, 1, 1, -1, -1, -1]",
        )
    if isinstance(given, str):
        return tuple(
            _filled(given, {"leg": leg, "index": leg - 1}) for leg in range(1, parameters.legs + 1)
        )
    if not set(given) <= {1, -1}:
        raise UsageError("config_options: branch is not 1 or -1 for each leg", action="Correct it")
    return cast("Branch", given)


class KeyedConfig:
    """A :class:`~hexacell.config.interface.ConfigFormat` of such texts.

    Raises:
        UsageError: an option names no parameter, two have the same key, or a branch is missing.
    """

    def __init__(
        self,
        parameters: ParameterSet,
        options: KeyedOptions,
        default: DefaultKey,
        open_text: OpenText,
        *,
        is_part: bool,
    ) -> None:
        symbols, every = {kind.symbol for kind in parameters.kinds}, parameters.parameters
        if unknown := sorted({*options.names, *options.corrections} - symbols):
            raise UsageError(
                f"config_options name '{unknown[0]}', which the mechanism has not",
                action=f"Its parameters are {', '.join(sorted(symbols))}",
            )
        self._parameters = parameters
        self._is_part = is_part
        # A parameter without a pattern of its own has the default key; one of several files has no signs.
        self._keys = {one.name: default(one) for one in every} | _keys_by(options.names, every)
        self._corrections = _keys_by(options.corrections, every)
        self._signs = None if is_part and options.branch is None else _branch_of(parameters, options)
        named = [one for one in self._signs or () if isinstance(one, str)]
        keys = [*self._keys.values(), *self._corrections.values(), *named]
        if twice := next((one for one in keys if keys.count(one) > 1), None):
            raise UsageError(
                f"config_options: two parameters are in '{twice}'",
                action="Distinguish them by {leg} or {index}, and by {component}",
            )
        self._open = open_text
        self._unit_mm = options.unit_mm

    def read(self, text: str, source: Path | None) -> interface.ConfigPart:
        """All parameters, or those whose keys are in the text; raises ``FileError`` with the line."""
        lookup, there = self._open(text, source), self._parameters.parameters
        if self._is_part:
            there = tuple(one for one in there if any(map(lookup.has, self._keys_of(one))))
        values = {one.name: self._value(lookup, one, source) for one in there}
        return interface.ConfigPart(values, self._branch(lookup, source))

    def rewrite(
        self, text: str, values: Mapping[str, float], corrections: Corrections | None = None
    ) -> str:
        """``text`` with these values of parameters, to 1 nm; a number that agrees to half of that is kept.

        Raises:
            FileError: the text is no such config, or has no place for the corrections.
        """
        assert corrections is None  # noqa: S101 - such a text has a place for none of them
        lookup, tokens = self._open(text, None), dict[interface.NumberToken, str]()
        for one in self._parameters.parameters:
            if one.name not in values:
                continue
            difference, decimals = values[one.name] - self._value(lookup, one, None), one.kind.unit.decimals
            if abs(difference) > 0.5 * 10.0**-decimals:
                token, unit = lookup.number(self._keys_of(one)[-1]), self._unit(one)
                tokens[token] = interface.write_number(
                    interface.number_of(token, None) * unit + difference, decimals, unit
                )
        return interface.replace_tokens(text, tokens)

    def _value(self, lookup: NumberLookup, parameter: GeometricParameter, source: Path | None) -> float:
        tokens = [lookup.number(key) for key in self._keys_of(parameter)]
        value = self._unit(parameter) * sum(interface.number_of(token, source) for token in tokens)
        if parameter.kind.is_positive and value <= 0.0:
            problem = f"{parameter.name} is {value:g}, but must be above zero"
            raise interface.token_error(tokens[-1], problem, source, "Correct it")
        return value

    def _keys_of(self, parameter: GeometricParameter) -> tuple[str, ...]:
        """The keys of the numbers whose sum it is; the last one is that which is written."""
        keys = (self._keys[parameter.name], self._corrections.get(parameter.name))
        return tuple(key for key in keys if key is not None)

    def _unit(self, parameter: GeometricParameter) -> float:
        return self._unit_mm if parameter.kind.unit is ParameterUnit.MM else 1.0

    def _branch(self, lookup: NumberLookup, source: Path | None) -> Branch | None:
        if self._signs is None:
            return None
        return cast("Branch", tuple(self._sign(lookup, one, source) for one in self._signs))

    def _sign(self, lookup: NumberLookup, key: str | int, source: Path | None) -> int:
        if isinstance(key, int):
            return key
        token = lookup.number(key)
        if (value := interface.number_of(token, source)) not in {1.0, -1.0}:
            raise interface.token_error(token, f"{key} is {token.text}", source, "It must be 1 or -1")
        return int(value)
