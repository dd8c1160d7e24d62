"""A kind of controller config: what the program needs from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

from hexacell.cell.fields import Frozen
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch

LARGEST_CONFIG_BYTES = 1_000_000
"""Largest config that is read, bytes; most have a few thousand."""

Range = tuple[float, float]
JointRanges = tuple[Range, ...]
AxisRanges = tuple[Range | None, ...]


class ControllerLimits(Frozen):
    """What a controller may be commanded to, by its own configuration.

    Attributes:
        joints: smallest and largest joint of each leg as the controller reports it; None: any.
        axes: smallest and largest command of x, y, z, mm, and of a, b, c, deg; None: any.
    """

    joints: JointRanges | None = None
    axes: AxisRanges | None = None

    def narrowed(self, other: ControllerLimits) -> ControllerLimits:
        """What both allow."""
        joints, axes = self.joints or other.joints, self.axes or other.axes
        if self.joints and other.joints:
            joints = tuple(map(_both, self.joints, other.joints))
        if self.axes and other.axes:
            pairs = zip(self.axes, other.axes, strict=True)
            axes = tuple(_both(one, two) if one and two else one or two for one, two in pairs)
        return ControllerLimits(joints=joints, axes=axes)


def _both(one: Range, other: Range) -> Range:
    return max(one[0], other[0]), min(one[1], other[1])


@dataclass(frozen=True, slots=True)
class ControllerGeometry:
    """The geometry that a controller uses, as its config states it, and the branch of the robot if any.

    ``limits`` are those that the config has, if any.
    """

    geometry: Geometry
    branch: Branch
    limits: ControllerLimits = field(default=ControllerLimits())


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


@dataclass(frozen=True, slots=True)
class ConfigPart:
    """What one of several files has of a geometry.

    Attributes:
        values: by the parameters' names, each in its unit.
        branch: that of the robot; None where the file has nothing to do with it.
        limits: those that the file has, if any.
    """

    values: Mapping[str, float]
    branch: Branch | None
    limits: ControllerLimits = field(default=ControllerLimits())


@runtime_checkable
class PartFormat(Protocol):
    """A format whose files may have a part of the geometry each.

    Its class takes ``is_part`` beside what that of a :class:`ConfigFormat` takes: then its options need not
    say where all parameters are.
    """

    def read_part(self, text: str, source: Path | None) -> ConfigPart:
        """The parameters that a text has, whichever they are; ``source`` is what errors name.

        Raises:
            FileError: one of them is there twice, or no number.
        """
        ...

    def rewrite_part(self, text: str, values: Mapping[str, float]) -> str:
        """``text`` with other values of parameters that it has; every other character is kept.

        Raises:
            FileError: it has one of them not, or cannot hold its value.
        """
        ...
