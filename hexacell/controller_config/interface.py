"""A kind of controller config: what the program needs from it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from hexacell.kinematics.geometry import Geometry

Sign = Literal[1, -1]
Branch = tuple[Sign, Sign, Sign, Sign, Sign, Sign]


@dataclass(frozen=True, slots=True)
class ControllerGeometry:
    """The geometry that a controller uses.

    Attributes:
        geometry: as the config states it.
        branch: for each leg, which of the two solutions of the inverse kinematics the robot uses.
    """

    geometry: Geometry
    branch: Branch


class ConfigFormat(Protocol):
    """A kind of controller config; a plug-in's class takes no arguments."""

    def read(self, path: Path) -> ControllerGeometry:
        """The geometry in the file.

        Raises:
            FileError: with file and line: absent, unreadable, or not a config that :meth:`rewrite` accepts.
        """
        ...

    def rewrite(self, text: str, geometry: Geometry) -> str:
        """``text`` with the values of ``geometry``; every other character is kept.

        Raises:
            FileError: ``text`` is not such a config, or cannot hold ``geometry``.
        """
        ...
