"""A kind of controller config: what the program needs from it, and the numbers in its text."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil, log10
from pathlib import Path
from typing import Protocol

from hexacell.cell.fields import LARGEST_NUMBER, Frozen
from hexacell.errors import FileError
from hexacell.kinematics.corrections import NO_CORRECTIONS, CorrectionKind, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch

LARGEST_CONFIG_BYTES = 1_000_000
"""Largest config that is read, bytes; most have a few thousand."""

Range = tuple[float, float]
JointRanges = tuple[Range, ...]
AxisRanges = tuple[Range | None, ...]


class ControllerLimits(Frozen):
    """What a controller may be commanded to, by its own configuration.

    Attributes:
        joints: smallest and largest joint of each leg as the controller reports it; None: any.
        axes: smallest and largest command of x, y, z, mm, and of a, b, c, deg; None: any.
    """

    joints: JointRanges | None = None
    axes: AxisRanges | None = None

    def narrowed(self, other: "ControllerLimits") -> "ControllerLimits":
        """What both allow."""
        joints, axes = self.joints or other.joints, self.axes or other.axes
        if self.joints and other.joints:
            joints = tuple(map(_both, self.joints, other.joints))
        if self.axes and other.axes:
            pairs = zip(self.axes, other.axes, strict=True)
            axes = tuple(_both(one, two) if one and two else one or two for one, two in pairs)
        return ControllerLimits(joints=joints, axes=axes)


def _both(one: Range, other: Range) -> Range:
    return max(one[0], other[0]), min(one[1], other[1])


@dataclass(frozen=True, slots=True)
class ControllerGeometry:
    """The geometry that a controller uses, as its config states it, and the branch of the robot if any.

    ``limits`` are those that the config has, if any; ``corrections`` are what the controller adds to its
    inverse kinematics, and ``holds`` are the kinds of these that its files have a place for.
    """

    geometry: Geometry
    branch: Branch
    limits: ControllerLimits = field(default=ControllerLimits())
    corrections: Corrections = NO_CORRECTIONS
    holds: frozenset[CorrectionKind] = frozenset()


@dataclass(frozen=True, slots=True)
class ConfigPart:
    """What one file has of that: all of it, or a part.

    Attributes:
        values: by the parameters' names, each in its unit.
        branch: that of the robot; None where the file has nothing to do with it.
    """

    values: Mapping[str, float]
    branch: Branch | None
    limits: ControllerLimits = field(default=ControllerLimits())
    corrections: Corrections = NO_CORRECTIONS
    holds: frozenset[CorrectionKind] = frozenset()


class ConfigFormat(Protocol):
    """A kind of controller config.

    A plug-in's class takes the parameters of the mechanism, ``[controller.config_options]`` of the cell
    file, a mapping that it checks by itself, and ``is_part``: whether the file is one of several, which has
    some of the parameters, whichever they are, and whose options need not say where the others are.
    """

    def read(self, text: str, source: Path | None) -> ConfigPart:
        """What a text has; ``source`` is what errors name.

        Raises:
            FileError: with the line of what is absent, there twice, no number, or not physical.
        """

    def rewrite(
        self, text: str, values: Mapping[str, float], corrections: Corrections | None = None
    ) -> str:
        """``text`` with other values of all parameters that it has; every other character is kept.

        With ``corrections`` it gets all numbers of these; those that are absent are added. Raises
        ``FileError`` if ``text`` is not such a config, or cannot hold these numbers.
        """


LARGEST_BACKLASH, LARGEST_PLAY_MM, LARGEST_COMPLIANCE_UM_N = 5.0, 5.0, 100.0
"""No machine that is worth calibrating has more."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
"""A decimal number as C, HAL and most controllers read it."""

_NUMBER = re.compile(NUMBER, re.ASCII)


@dataclass(frozen=True, slots=True)
class NumberToken:
    """A number in a text: the characters ``start`` to ``end``, in a line counted from 1."""

    text: str
    start: int
    end: int
    line: int


def write_number(value: float, decimals: int, unit: float = 1.0) -> str:
    """``value`` with at most so many decimals and at least one, never ``-0.0``, no exponent.

    In a larger ``unit`` it has as many decimals more.
    """
    whole, _, rest = f"{value / unit:.{decimals + max(0, ceil(log10(unit)))}f}".partition(".")
    number = f"{whole}.{rest.rstrip('0') or '0'}"
    return "0.0" if number == "-0.0" else number


def replace_tokens(text: str, changed: Mapping[NumberToken, str]) -> str:
    """``text`` with other numbers in the places of some tokens; every other character is kept."""
    parts, end = [], 0
    for token in sorted(changed, key=lambda one: one.start):
        parts += [text[end : token.start], changed[token]]
        end = token.end
    return "".join([*parts, text[end:]])


def token_error(token: NumberToken, problem: str, source: Path | None, action: str) -> FileError:
    """What is wrong with a number, with its line."""
    return FileError(problem, subject=source, line=token.line, action=action)


def number_of(token: NumberToken, source: Path | None) -> float:
    """Its value; raises ``FileError`` with its line if it is none, or beyond what a geometry can hold."""
    problem = f"{token.text!r} is not a number"
    if _NUMBER.fullmatch(token.text):
        if abs(value := float(token.text)) <= LARGEST_NUMBER:
            return value
        problem = f"{token.text} is not within +-{LARGEST_NUMBER:g}"
    raise token_error(token, problem, source, "Write a plain number there")
