"""The ways to a LinuxCNC: what it says of itself, and what it is told, whatever brings it there.

Only Python's own library is used, here and in machine.py: a program under LinuxCNC's own interpreter needs
both too.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Protocol

from drivers.controllers.adapter.served_robot import FailedError, Told

MDI = "mdi"
"""The mode in which single blocks are executed."""

ALONE = "See that nobody else moves the robot, then prepare it again"
_OFFSET = 1e-6
_FULL_PERCENT = 100.0 + 1e-4


class Order(Enum):
    """What is asked for beside blocks, in the words of linuxcncrsh."""

    ESTOP_OFF = "estop off"
    MACHINE_ON = "machine on"
    MACHINE_OFF = "machine off"
    MANUAL = "mode manual"
    MDI = "mode mdi"
    TELEOP_OFF = "teleop_enable off"
    HOME = "home -1"


class State(Protocol):
    """What LinuxCNC says of itself, read when it is asked for or before.

    Attributes:
        mode: ``manual``, ``automatic`` or ``mdi``.
        is_at_rest: nothing moves, and nothing waits that would.
        runs_program: another client has it execute a program.
        pose: the actual one, x, y, z, mm, and a, b, c, deg.
        joints: the six actual ones, mm or deg.
        codes: the active G codes and the feed, ``G0 G21 G90 F0``.
        offset: what is added to every coordinate, mm and deg.
        feed_percent: the feed override.
    """

    @property
    def is_on(self) -> bool: ...
    @property
    def estop(self) -> bool: ...
    @property
    def is_homed(self) -> bool: ...
    @property
    def mode(self) -> str: ...
    @property
    def is_teleop(self) -> bool: ...
    @property
    def is_at_rest(self) -> bool: ...
    @property
    def runs_program(self) -> bool: ...
    @property
    def pose(self) -> Sequence[float]: ...
    @property
    def joints(self) -> Sequence[float]: ...
    @property
    def codes(self) -> str: ...
    @property
    def offset(self) -> Sequence[float]: ...
    @property
    def feed_percent(self) -> float: ...

    def is_at(self, pose: Sequence[float]) -> bool:
        """Whether it is at a pose that it was told to move to."""


class Access(Protocol):
    """One way to it; ``state``, ``messages`` and ``abort`` are called while others wait.

    All of these raise ``FailedError`` where LinuxCNC refuses, and end the service where it is gone.

    Attributes:
        poll_s: the pause between two looks at it, s.
        is_refused: whether it refused the block that was begun last.
    """

    poll_s: float
    is_refused: bool

    def connect(self, told: Told) -> Told:
        """Connect; its name and description. Nothing moves."""

    def claim(self) -> None:
        """Take control, where one client has it, from another that took it since."""

    def state(self) -> State:
        """Its state now."""

    def order(self, order: Order) -> bool:
        """Give an order; whether it is accepted, which does not prove an effect."""

    def begin(self, block: str) -> None:
        """Have a block executed, and return before its end."""

    def is_over(self, state: State, pose: Sequence[float] | None = None) -> bool:
        """Whether the block that was begun is over, at the pose to which it moves or where it ended."""

    def abort(self) -> None:
        """Stop what moves, at once; returns at rest."""

    def messages(self) -> list[str]:
        """Its error messages that nobody has read yet."""


def foreign_mode(state: State) -> FailedError:
    """The failure where another client took it out of MDI mode."""
    reason = f"another client has put it into {state.mode} mode"
    return FailedError("refused", reason, action=ALONE)


def require_own_coordinates(state: State) -> None:
    """Require that ``G21 X1`` means 1 mm in machine coordinates, and a duration what it says.

    Raises:
        FailedError: Relative moves, a tool length, an offset or a feed override is active.
    """
    codes = state.codes.upper().split()
    if "G91" in codes:
        problem, action = "takes coordinates as relative (G91)", "Send G90 in MDI, or as its startup code"
    elif "G43" in codes:
        problem, action = "adds a tool length (G43)", "Send G49 in MDI, or as its startup code"
    elif any(abs(value) > _OFFSET for value in state.offset):
        offset = " ".join(f"{value:g}" for value in state.offset)
        problem = f"adds an offset of {offset} to every coordinate (G54, G92)"
        action = "Clear it: G10 L2 P1 X0 Y0 Z0 A0 B0 C0 and G92.1 in MDI"
    elif state.feed_percent > _FULL_PERCENT:
        problem = f"moves {state.feed_percent:g} % as fast as it is commanded (feed override)"
        action = "Set the feed override to 100 % or less"
    else:
        return
    raise FailedError("refused", problem, action=action)
