"""A kind of controller config: what the program needs from it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch

LARGEST_CONFIG_BYTES = 1_000_000
"""Of a file, which usually has a few thousand."""

JointRanges = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class ControllerGeometry:
    """The geometry that a controller uses, as its config states it, and the branch of the robot if any.

    ``joint_ranges`` are the smallest and largest joint variable of each leg, mm, where the config has them.
    """

    geometry: Geometry
    branch: Branch
    joint_ranges: JointRanges | None = None


class ConfigFormat(Protocol):
    """A kind of controller config.

    A plug-in's class takes the parameters of the mechanism and ``[controller.config_options]`` of the cell
    file, a mapping that it checks by itself.
    """

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
