"""Blocks that LinuxCNC's interpreter is given, and its refusals, whatever brings them there.

Only Python's own library is used: a program under LinuxCNC's own interpreter needs them too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

_DECIMALS = 8
_AXIS_LIMIT = re.compile(
    r"would exceed (?P<axis>[XYZABC])'s (?P<side>positive|negative) limit", re.IGNORECASE
)
_UNREACHABLE = re.compile(
    r"would exceed (?:joint \d+'s|limits)|fails kinematicsInverse|gave non-finite joint location",
    re.IGNORECASE,
)


def timed_move(pose: Sequence[float], duration_s: float, coordinates: str = "xyzabc") -> str:
    """The block that moves to some coordinates, mm and deg, in inverse time: F is 1 / duration, in 1/min.

    In millimetres (G21), and in machine coordinates (G53): no query shows that the coordinate system is
    rotated (G10 L2 R). It has more decimals than the six of reported positions. A feed rate (G94) would
    count X, Y and Z only (LinuxCNC, G-code reference, G93 and G94), and a rapid move (G0) goes as fast as
    it can.

    Raises:
        ValueError: A coordinate is not a finite number.
    """
    if not all(map(math.isfinite, pose)):
        raise ValueError("a coordinate is not a finite number")
    words = " ".join(
        f"{axis}{value:.{_DECIMALS}f}" for axis, value in zip(coordinates.upper(), pose, strict=True)
    )
    return f"G21 G53 G93 G1 {words} F{60.0 / duration_s:.{_DECIMALS}f}"


def restoring_block(codes: str) -> str:
    """The block that restores what :func:`timed_move` changes, from the active codes.

    That are inches, the motion, the feed mode, and the feed, which a change of its mode sets to zero. A G1
    that has no feed is refused, and other motions need more words: instead, no motion is active (G80).
    """
    words = codes.upper().split()
    mode = next((word for word in words if word in ("G93", "G94", "G95")), "G94")
    feed = next((word for word in words if word.startswith("F")), "F0")
    has_feed = mode != "G93" and float(feed[1:]) != 0.0
    motion = "G0" if not words or "G0" in words else "G1" if "G1" in words and has_feed else "G80"
    units = ("G20",) if "G20" in words else ()
    return " ".join((*units, mode, motion, *((feed,) if has_feed else ())))


def parse_pose_refusal(reason: str) -> tuple[str | None, bool] | None:
    """Why a pose is refused; None if the messages say that something else prevents the move.

    It is the axis beyond whose limit it is, one of ``xyzabc`` or None for another reason, and whether that
    limit is its highest value.

    The messages are those of LinuxCNC's motion module (``command.c``): ``would exceed C's positive limit``,
    ``would exceed joint 3's negative limit``, ``fails kinematicsInverse``.
    """
    if found := _AXIS_LIMIT.search(reason):
        return found["axis"].lower(), found["side"].lower() == "positive"
    return (None, True) if _UNREACHABLE.search(reason) else None
