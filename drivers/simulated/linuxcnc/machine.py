"""What a simulated controller drives."""

from __future__ import annotations

from typing import Protocol

from hexacell.kinematics.pose import Pose


class KinematicsFailure(Exception):
    """The geometry that the controller has cannot take the machine there."""


class Machine(Protocol):
    """The machine behind the controller, called from several threads at once.

    While ``move`` or ``home`` blocks in one thread, any other method may be called from another.
    """

    def move(self, pose: Pose) -> None:
        """Go to ``pose``; returns when the motion has ended or was stopped.

        Raises:
            KinematicsFailure: The geometry cannot reach it; nothing moves.
        """
        ...

    def stop(self) -> None:
        """Stop a motion in place, if there is one."""
        ...

    def pose(self) -> Pose:
        """Where the controller believes the platform to be, from the joints and its geometry."""
        ...

    def joints(self) -> tuple[float, ...]:
        """The six joints as they are, mm."""
        ...

    def switch_on(self) -> None:
        """Enable the drives; the geometry is read from the config file here, and only here.

        Raises:
            HexacellError: The config cannot be used; the machine stays off.
        """
        ...

    def switch_off(self) -> None:
        """Disable the drives; the joints stay where they are."""
        ...

    def home(self) -> None:
        """Find the joints' references; returns when that has ended or was stopped."""
        ...
