"""A config that somebody edited: as it was before a run, as the run wrote it, and as it is now."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hexacell.config.change import diff_of_files
from hexacell.config.contents import Contents, read_contents
from hexacell.config.layout import ConfigLayout
from hexacell.errors import FileError, HexacellError
from hexacell.kinematics.geometry import Geometry


@dataclass(frozen=True, slots=True)
class NumberVersions:
    """One number of the geometry in three versions of a config, in its unit.

    ``now`` is none where the config of now has no geometry that can be read.
    """

    name: str
    unit: str
    before: float
    written: float
    now: float | None

    @property
    def is_edited(self) -> bool:
        """Whether the number of now is from neither of the other two."""
        return self.now is not None and self.now not in {self.before, self.written}


@dataclass(frozen=True, slots=True)
class ConfigVersions:
    """The numbers that are not the same in all three versions, and the edit as a text change.

    Attributes:
        edit: from the version that the config of now is most like to now, as a unified diff.
        is_from_written: whether that is the version which the run wrote.
    """

    numbers: tuple[NumberVersions, ...]
    edit: str
    is_from_written: bool


class ConfigEditedSince(FileError):
    """The config is neither as it was before a run nor as the run wrote it.

    Attributes:
        versions: all three.
    """

    def __init__(self, problem: str, versions: ConfigVersions, *, path: Path, action: str) -> None:
        super().__init__(problem, subject=path, action=action)
        self.versions = versions


def compare_versions(
    paths: tuple[Path, ...],
    layout: ConfigLayout,
    before: tuple[Geometry, Contents],
    written: tuple[Geometry, Contents],
) -> ConfigVersions:
    """Compare the config in these files with two versions of it, each a geometry and what the files held.

    Raises:
        FileError: a file cannot be read.
    """
    now = read_contents(paths)
    edits = [diff_of_files(paths, version, now) for _, version in (before, written)]
    is_from_written = len(edits[1]) <= len(edits[0])
    numbers = _numbers(before[0], written[0], _geometry_now(paths, layout))
    return ConfigVersions(numbers, edits[is_from_written], is_from_written)


def _geometry_now(paths: tuple[Path, ...], layout: ConfigLayout) -> Geometry | None:
    try:
        return layout.read(*paths).geometry
    except HexacellError:
        return None


def _numbers(before: Geometry, written: Geometry, now: Geometry | None) -> tuple[NumberVersions, ...]:
    parameters = before.parameters.parameters
    last = [None] * len(parameters) if now is None else now.vector.tolist()
    values = zip(parameters, before.vector.tolist(), written.vector.tolist(), last, strict=True)
    found = (NumberVersions(one.name, one.kind.unit.value, *three) for one, *three in values)
    return tuple(one for one in found if len({one.before, one.written, one.now}) > 1)
