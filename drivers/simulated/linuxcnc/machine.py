"""The machine interface of the simulated controller."""

from __future__ import annotations

from typing import Protocol

from hexacell.kinematics.pose import Pose


class KinematicsFailure(Exception):
    """The target is out of reach of the controller's geometry."""


class Machine(Protocol):
    """The machine behind the controller, called from several threads.

    While ``move`` or ``home`` blocks in one thread, any other method may be called from another.
    """

    def move(self, pose: Pose) -> None:
        """Move to ``pose``; returns when the motion has ended or was stopped.

        Raises:
            KinematicsFailure: The geometry cannot reach it; nothing moves.
        """
        ...

    def stop(self) -> None:
        """Stop a motion in place, if there is one."""
        ...

    def pose(self) -> Pose:
        """The pose by the joint positions and the controller's geometry."""
        ...

    def joints(self) -> tuple[float, ...]:
        """The six joint positions, mm."""
        ...

    def switch_on(self) -> None:
        """Enable the drives; the geometry is read from the config file here only.

        Raises:
            HexacellError: The config cannot be used; the machine stays off.
        """
        ...

    def switch_off(self) -> None:
        """Disable the drives; the joints stay where they are."""
        ...

    def home(self) -> None:
        """Home the joints; returns when that has ended or was stopped."""
        ...
