"""What the program must know about a kind of controller config, and nothing more."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from hexacell.kinematics.geometry import Geometry

Sign = Literal[1, -1]
Branch = tuple[Sign, Sign, Sign, Sign, Sign, Sign]


@dataclass(frozen=True, slots=True)
class ControllerGeometry:
    """The geometry that a controller computes with.

    Attributes:
        geometry: the 42 numbers as the config states them, mm.
        branch: for each leg, which of the two solutions of the inverse kinematics the robot is in.
    """

    geometry: Geometry
    branch: Branch


class ConfigFormat(Protocol):
    """A kind of controller config; a plug-in's class is made without arguments."""

    def read(self, path: Path) -> ControllerGeometry:
        """The geometry in the file.

        Raises:
            FileError: with file and line: absent, unreadable, or not what the controller needs.
        """
        ...

    def rewrite(self, text: str, geometry: Geometry) -> str:
        """``text`` with the values of ``geometry`` in it, and every other character as it was.

        Raises:
            FileError: ``text`` is no such config, or ``geometry`` is none that it can hold.
        """
        ...
