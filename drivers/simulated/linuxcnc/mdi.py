"""Parsing of one MDI block: a rapid move, and LinuxCNC's error messages for anything else."""

from __future__ import annotations

import re

from hexacell.kinematics.pose import Pose

_WORD = re.compile(r"([XYZABC])([+-]?(?:\d+\.?\d*|\.\d+))")


class BlockError(Exception):
    """A block that the interpreter refuses, with LinuxCNC's message."""


def parse_block(block: str, current: Pose) -> Pose:
    """The target of ``block`` from ``current``; missing words keep their values.

    Raises:
        BlockError: It is no rapid move.
    """
    text = "".join(block.split()).upper()
    if not text.startswith("G0"):
        raise BlockError("Unknown g code used")
    words = text.removeprefix("G0")
    if _WORD.sub("", words):
        raise BlockError("No characters found in reading real value")
    coordinates = dict(zip("XYZABC", current.as_tuple(), strict=True))
    coordinates |= {axis: float(value) for axis, value in _WORD.findall(words)}
    return Pose(*coordinates.values())
