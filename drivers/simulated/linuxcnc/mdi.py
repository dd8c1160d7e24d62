"""Parsing of one MDI block: rapid moves, and LinuxCNC's error messages for anything else."""

from __future__ import annotations

import re

from hexacell.kinematics.pose import Pose

_WORD = re.compile(r"([A-Za-z])([+-]?(?:\d+\.?\d*|\.\d+))")
_AXES = "XYZABC"
_MOVES = (0.0, 1.0)
_MODES = (17.0, 21.0, 49.0, 54.0, 64.0, 90.0, 94.0)
"""G codes of the modes that are always active here."""


class BlockError(Exception):
    """A block that the interpreter refuses, with LinuxCNC's message."""


def parse_block(block: str, current: Pose) -> Pose | None:
    """The target of ``block`` from ``current``; missing words keep their values.

    None for a block without motion.

    Raises:
        BlockError: It is no rapid move.
    """
    words = _words(block)
    coordinates = dict(zip(_AXES, current.as_tuple(), strict=True))
    goes = False
    for letter, value in words:
        if letter == "G":
            _check_code(value)
        elif letter in _AXES:
            coordinates[letter] = value
            goes = True
        elif letter != "F":
            raise BlockError(f"Bad character '{letter.lower()}' used")
    return Pose(*coordinates.values()) if goes else None


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


def _check_code(code: float) -> None:
    if code not in _MOVES + _MODES:
        raise BlockError("G-code out of range" if code >= 100 else "Unknown g code used")
