"""What LinuxCNC's status says, as ``linuxcnc.stat`` has it: poses, modes, whose coordinates they are.

Only Python's own library is used, as in program.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.linuxcnc import gcode

try:
    linuxcnc: Any = import_module("linuxcnc")
except ImportError:  # told when a controller is asked for
    linuxcnc = None

AXES = 6
OFFSET = 1e-6
SAME_MM, SAME_DEG = 0.01, 0.01


def is_on(stat: Any) -> bool:  # noqa: ANN401 - of a module without types
    """Whether it may move."""
    return bool(stat.task_state == linuxcnc.STATE_ON)


def is_homed(stat: Any) -> bool:  # noqa: ANN401
    """Whether all joints are homed."""
    return all(stat.homed[: stat.joints])


def is_at_rest(stat: Any) -> bool:  # noqa: ANN401
    """Whether nothing moves, and nothing waits that would."""
    is_homing = any(joint["homing"] for joint in stat.joint[: stat.joints])
    return bool(
        stat.inpos and stat.queue == 0 and stat.interp_state == linuxcnc.INTERP_IDLE and not is_homing
    )


def pose_of(stat: Any, position: Sequence[float]) -> list[float]:  # noqa: ANN401
    """A position in its units as x, y, z, mm, and a, b, c, deg."""
    lengths = [value / stat.linear_units for value in position[:3]]
    return lengths + [value / stat.angular_units for value in position[3:AXES]]


def joints_of(stat: Any) -> list[float]:  # noqa: ANN401
    """The six actual joints, mm or deg."""
    return [
        value / (stat.angular_units if joint["jointType"] == linuxcnc.ANGULAR else stat.linear_units)
        for value, joint in zip(stat.joint_actual_position[:AXES], stat.joint[:AXES], strict=True)
    ]


def agree(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether two poses are the same."""
    differences = [abs(a - b) for a, b in zip(one, other, strict=True)]
    return (
        max(differences[:3]) < SAME_MM
        and max(abs((d + 180) % 360 - 180) for d in differences[3:]) < SAME_DEG
    )


def restoring_block(stat: Any) -> str:  # noqa: ANN401
    """The block that restores its present modes after a timed move."""
    codes = [f"G{code / 10:g}" for code in stat.gcodes[1:] if code >= 0]
    return gcode.restoring_block(" ".join((*codes, f"F{stat.settings[1]:g}")))


def foreign_mode(stat: Any) -> str:  # noqa: ANN401
    """Who took it out of MDI mode, in words."""
    mode = {linuxcnc.MODE_MANUAL: "manual", linuxcnc.MODE_AUTO: "automatic"}.get(stat.task_mode, "another")
    return f"another client has put it into {mode} mode"


def require_own_coordinates(stat: Any) -> None:  # noqa: ANN401
    """Require that G21 X1 means 1 mm in machine coordinates, and a duration what it says."""
    offsets = " ".join(
        f"{axis}{value:g}"
        for axis, value in zip(2 * "XYZABCUVW", (*stat.g5x_offset, *stat.g92_offset), strict=True)
        if abs(value) > OFFSET
    )
    if 910 in stat.gcodes:
        problem, action = "takes coordinates as relative (G91)", "Send G90 in MDI"
    elif 430 in stat.gcodes or any(abs(value) > OFFSET for value in stat.tool_offset):
        problem, action = "adds a tool length (G43)", "Send G49 in MDI"
    elif offsets:
        problem = f"adds an offset of {offsets} to every coordinate (G54, G92)"
        action = "Clear it: G10 L2 P1 X0 Y0 Z0 A0 B0 C0 and G92.1 in MDI"
    elif stat.feedrate > 1.0 + OFFSET:
        problem = f"moves {100 * stat.feedrate:g} % as fast as it is commanded (feed override)"
        action = "Set the feed override to 100 % or less"
    else:
        return
    raise FailedError("refused", problem, action=action)
