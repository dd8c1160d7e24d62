"""Versions of a controller's config, number by number: before a run, as written, and edited since."""

from dataclasses import dataclass
from pathlib import Path

from hexacell.config.change import diff_of_files
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import ConfigLayout, Contents, read_contents
from hexacell.errors import FileError, HexacellError


@dataclass(frozen=True, slots=True)
class NumberVersions:
    """One number of the geometry or of the corrections in three versions of a config, in its unit.

    ``now`` is None where the current config has no geometry that can be read.
    """

    name: str
    unit: str
    before: float
    written: float
    now: float | None

    @property
    def is_edited(self) -> bool:
        """Whether the current number is from neither of the other two versions."""
        return self.now is not None and self.now not in {self.before, self.written}


@dataclass(frozen=True, slots=True)
class ConfigVersions:
    """The numbers that are not the same in all three versions, and the edit as a text change.

    Attributes:
        edit: the changes from the most similar version to the current config, as a unified diff.
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
    before: tuple[ControllerGeometry, Contents],
    written: tuple[ControllerGeometry, Contents],
) -> ConfigVersions:
    """Compare the config in these files with two versions of it, each as read and what the files held.

    Raises:
        FileError: a file cannot be read.
    """
    now = read_contents(paths)
    edits = [diff_of_files(paths, version, now) for _, version in (before, written)]
    is_from_written = len(edits[1]) <= len(edits[0])
    old, new = (numbers_of(version, layout) for version, _ in (before, written))
    current = config_if_readable(paths, layout)
    last = None if current is None else numbers_of(current, layout)
    units = {name: unit for every in (old, new, last or {}) for name, (unit, _) in every.items()}
    found = (
        NumberVersions(
            name,
            unit,
            old.get(name, (unit, 0.0))[1],
            new.get(name, (unit, 0.0))[1],
            None if last is None else last.get(name, (unit, 0.0))[1],
        )
        for name, unit in units.items()
    )
    numbers = tuple(one for one in found if len({one.before, one.written, one.now}) > 1)
    return ConfigVersions(numbers, edits[is_from_written], is_from_written)


def numbers_of(config: ControllerGeometry, layout: ConfigLayout) -> dict[str, tuple[str, float]]:
    """Unit and value of each number of a config, by its name: the geometry's, then the corrections'."""
    geometry = config.geometry
    found = {
        one.name: (str(one.kind.unit), value)
        for one, value in zip(geometry.parameters.parameters, geometry.vector.tolist(), strict=True)
    }
    return found | {
        name: (unit, value) for name, unit, value in config.corrections.numbers(layout.joint_unit)
    }


def config_if_readable(paths: tuple[Path, ...], layout: ConfigLayout) -> ControllerGeometry | None:
    """What the files state; None where they cannot be read."""
    try:
        return layout.read(*paths)
    except HexacellError:
        return None
