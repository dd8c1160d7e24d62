"""Versions of a controller's config, number by number: before a run, as written, and edited since."""

from collections.abc import Iterator, Sequence
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
    """The config is neither as it was before a run nor as the run wrote it; ``versions`` are all three."""

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
    current = config_if_readable(paths, layout)
    readable = [before[0], written[0], *([] if current is None else [current])]
    numbers = tuple(
        NumberVersions(name, unit, values[0], values[1], values[2] if current is not None else None)
        for name, unit, values in numbers_of(readable, layout)
        if len(set(values)) > 1 or current is None
    )
    return ConfigVersions(numbers, edits[is_from_written], is_from_written)


def numbers_of(
    configs: Sequence[ControllerGeometry], layout: ConfigLayout
) -> Iterator[tuple[str, str, list[float]]]:
    """Name and unit of each number of the geometry and the corrections, with its values in some configs.

    A number that a config does not have is zero there.
    """
    units: dict[str, str] = {}
    found: list[dict[str, float]] = []
    for config in configs:
        parameters, geometry = config.geometry.parameters.parameters, config.geometry.vector.tolist()
        numbers = [
            (one.name, str(one.kind.unit), value) for one, value in zip(parameters, geometry, strict=True)
        ]
        numbers += config.corrections.numbers(layout.joint_unit)
        units |= {name: unit for name, unit, _ in numbers}
        found.append({name: value for name, _, value in numbers})
    for name, unit in units.items():
        yield name, unit, [one.get(name, 0.0) for one in found]


def config_if_readable(paths: tuple[Path, ...], layout: ConfigLayout) -> ControllerGeometry | None:
    """What the files state; None where they cannot be read."""
    try:
        return layout.read(*paths)
    except HexacellError:
        return None
