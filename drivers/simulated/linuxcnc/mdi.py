"""Parsing of one MDI block: rapid moves, moves at a feed or of a duration, LinuxCNC's error messages."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hexacell.kinematics.pose import Pose

_WORD = re.compile(r"([A-Za-z])([+-]?(?:\d+\.?\d*|\.\d+))")
_AXES = "XYZABC"
_MOTIONS = (0.0, 1.0, 80.0)
_FEED_MODES = (93.0, 94.0)
_MODES = (17.0, 21.0, 49.0, 54.0, 64.0, 90.0)
"""G codes of the modes that are always active here."""

_MACHINE_COORDINATES = 53.0
_NOWHERE = (0.0,) * len(_AXES)

INVERSE_TIME, PER_MINUTE = 93, 94
_NO_MOTION = 80


class BlockError(Exception):
    """A block that the interpreter refuses, with LinuxCNC's message."""


@dataclass(frozen=True, slots=True)
class ModalState:
    """What a block leaves to those after it: G0, G1 or G80, G93 or G94, and the feed of G94, mm/min.

    ``offset`` is that of the coordinate system (G54, G92), mm and deg: the answer to ``get pos_offset``.
    """

    motion: int = 0
    feed_mode: int = PER_MINUTE
    feed: float = 0.0
    offset: tuple[float, ...] = _NOWHERE

    @property
    def codes(self) -> str:
        """The answer to ``get program_codes``."""
        modes = f"G{self.motion} G17 G40 G21 G90 G{self.feed_mode} G54 G49 G99 G64 G97 G91.1 G8 G92.2"
        return f"{modes} F{self.feed:g} S0"


@dataclass(frozen=True, slots=True)
class ParsedBlock:
    """What a block does.

    Attributes:
        modes: those after it.
        target: where it goes; None if it moves nothing.
        duration_s: how long the move is to last; None for a rapid one.
    """

    modes: ModalState
    target: Pose | None = None
    duration_s: float | None = None


def parse_block(block: str, current: Pose, modes: ModalState | None = None) -> ParsedBlock:
    """What ``block`` does from ``current``; missing words keep their values.

    Raises:
        BlockError: It is no move that this machine knows.
    """
    words = _words(block)
    codes = [value for letter, value in words if letter == "G"]
    numbers = {letter: value for letter, value in words if letter != "G"}
    before = modes or ModalState()
    for letter in numbers:
        if letter not in (*_AXES, "F"):
            raise BlockError(f"Bad character '{letter.lower()}' used")
    feed = numbers.pop("F", None)
    for code in codes:
        if code not in (*_MOTIONS, *_FEED_MODES, *_MODES, _MACHINE_COORDINATES):
            raise BlockError("G-code out of range" if code >= 100 else "Unknown g code used")
    motion = _one_of_group(codes, _MOTIONS, before.motion)
    feed_mode = _one_of_group(codes, _FEED_MODES, before.feed_mode)
    kept = before.feed if feed_mode == before.feed_mode == PER_MINUTE else 0.0
    stated = feed if feed is not None and feed_mode == PER_MINUTE else kept
    after = replace(before, motion=motion, feed_mode=feed_mode, feed=stated)
    if not numbers and 1.0 not in codes:
        return ParsedBlock(after)
    shifts = _NOWHERE if _MACHINE_COORDINATES in codes else after.offset
    here = zip(_AXES, current.as_tuple(), shifts, strict=True)
    target = Pose(*(numbers[axis] + shift if axis in numbers else value for axis, value, shift in here))
    duration_s = _duration(after, feed, current, target)
    return ParsedBlock(after, target, duration_s) if numbers else ParsedBlock(after)


def _one_of_group(codes: Sequence[float], group: tuple[float, ...], before: int) -> int:
    found = [code for code in codes if code in group]
    if len(found) > 1:
        raise BlockError("Two g codes used from same modal group")
    return int(found[0]) if found else before


def _duration(modes: ModalState, feed: float | None, start: Pose, end: Pose) -> float | None:
    """Duration of a move in these modes, s: its share of a minute, or what X, Y and Z take at the feed."""
    if modes.motion == 0:
        return None
    if modes.motion == _NO_MOTION:
        raise BlockError("Cannot use axis values without a g code that uses them")
    if modes.feed_mode == INVERSE_TIME:
        if not feed:
            raise BlockError("F word missing with inverse time g1 move")
        return 60.0 / feed
    if not modes.feed:
        raise BlockError("Cannot do g1 with zero feed rate")
    changes = [b - a for a, b in zip(start.as_tuple(), end.as_tuple(), strict=True)]
    return 60.0 * (math.hypot(*changes[:3]) or math.hypot(*changes[3:])) / modes.feed


def _words(block: str) -> list[tuple[str, float]]:
    text = "".join(block.split())
    found = [(match[1].upper(), float(match[2])) for match in _WORD.finditer(text)]
    if _WORD.sub("", text):
        raise BlockError("No characters found in reading real value")
    axes = [letter for letter, _ in found if letter != "G"]
    for letter in axes:
        if axes.count(letter) > 1:
            raise BlockError(f"Multiple {letter.lower()} words on one line")
    return found
