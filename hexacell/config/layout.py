"""Which files a controller's geometry is in, in which format each of them is, and what they hold now.

Most controllers have it in one file. Of LinuxCNC's ``genhexkins`` base and platform may be in a HAL file
and the zeros of the legs in the INI file. Each parameter is looked for in every file and must be in one.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Self

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.config import interface
from hexacell.config.linuxcnc_ini import limits_of_ini
from hexacell.errors import FileError
from hexacell.kinematics.corrections import NO_CORRECTIONS, CorrectionKind, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.parameters import JointUnit, ParameterSet
from hexacell.plugins import Group, created
from hexacell.storage import atomic_files

CORRECTIONS_ROUNDED = 2e-6
"""By how much a correction may read back otherwise, in its unit."""


@dataclass(frozen=True, slots=True)
class FormatOfFile:
    """The format of one file, and what the cell file calls it."""

    name: str
    reader: interface.ConfigFormat


@dataclass(frozen=True, slots=True)
class ConfigLayout:
    """The formats of a config's files, in the order in which the cell file names the files.

    Every method takes one path or text for each of them, in that order.
    """

    parameters: ParameterSet
    formats: tuple[FormatOfFile, ...]
    joint_unit: JointUnit = JointUnit.MM

    @classmethod
    def of(cls, settings: CellSettings) -> Self:
        """The layout of a cell's controller config.

        Raises:
            UsageError: there is no such format, or its options are wrong.
        """
        controller, parameters = settings.controller, settings.mechanism.parameters
        is_part = bool(controller.further_files)
        files = [(controller.config_format, controller.config_options)]
        files += [(one.config_format, one.config_options) for one in controller.further_files]
        formats = tuple(
            FormatOfFile(name, created(Group.CONFIG_FORMATS, name, parameters, options, is_part=is_part))
            for name, options in files
        )
        return cls(parameters, formats, settings.mechanism.words.joint_unit)

    def read(self, *paths: Path) -> interface.ControllerGeometry:
        """The geometry in the files, and the corrections.

        Raises ``FileError``, with file and line, if a file is absent, unreadable or no such config, or a
        parameter is in none of the files, or in two.
        """
        parts = self._parts(
            [atomic_files.read_text(path, interface.LARGEST_CONFIG_BYTES) for path in paths], paths
        )
        values = self._values(parts, paths)
        corrections, places = _corrections(parts, paths)
        return interface.ControllerGeometry(
            Geometry(self.parameters, [values[name] for name in self.parameters.names]),
            self._branch(parts, paths),
            reduce(interface.ControllerLimits.narrowed, (part.limits for part in parts)),
            corrections,
            frozenset(places),
        )

    def rewrite(
        self, texts: Sequence[str], geometry: Geometry, corrections: Corrections | None = None
    ) -> tuple[str, ...]:
        """The texts with the values of ``geometry`` and ``corrections``; every other character is kept.

        Without ``corrections`` they stay as they are. New texts are read again before they are returned.
        Raises ``FileError`` if a text is no such config, or cannot hold its part of these; or if the
        geometry has values that no config may get.
        """
        positive = [geometry[kind.symbol] for kind in self.parameters.kinds if kind.is_positive]
        if not np.isfinite(geometry.vector).all() or not all((one > 0.0).all() for one in positive):
            raise FileError(
                "the new geometry has values that are not finite, or lengths that are not above zero",
                action="Nothing was written; identify again",
            )
        values = dict(zip(self.parameters.names, geometry.vector.tolist(), strict=True))
        stand_ins = [Path(f"file {number}") for number, _ in enumerate(texts, start=1)]
        parts = self._parts(texts, [None] * len(texts))
        self._values(parts, stand_ins)
        found, places = _corrections(parts, stand_ins)
        if corrections is not None:
            _require_places(corrections, found, places)
        new: list[str] = []
        for place, (one, text, part) in enumerate(zip(self.formats, texts, parts, strict=True)):
            kinds = [kind for kind, where in places.items() if where == place]
            own = NO_CORRECTIONS.taking(corrections, kinds) if corrections is not None and kinds else None
            new.append(one.reader.rewrite(text, {name: values[name] for name in part.values}, own))
        after = self._parts(new, [None] * len(new))
        read_back, corrected = self._values(after, stand_ins), _corrections(after, stand_ins)[0]
        wanted = found if corrections is None else found.taking(corrections, [*places])
        wrong = [
            one.name
            for one in self.parameters.parameters
            if abs(read_back[one.name] - values[one.name]) > 10.0**-one.kind.unit.decimals
        ]
        changes = wanted.changes_to(corrected, self.joint_unit)
        wrong += [one.name for one in changes if abs(one.after - one.before) > CORRECTIONS_ROUNDED]
        if wrong:
            raise FileError(
                f"the new config reads back with another {wrong[0]}",
                action="Nothing was written; please report this with the config",
            )
        return tuple(new)

    def _parts(self, texts: Sequence[str], sources: Sequence[Path | None]) -> list[interface.ConfigPart]:
        files = zip(self.formats, texts, sources, strict=True)
        return [one.reader.read(text, source) for one, text, source in files]

    def _values(self, parts: Sequence[interface.ConfigPart], paths: Sequence[Path]) -> Mapping[str, float]:
        found: dict[str, float] = {}
        for name in self.parameters.names:
            having = [path for part, path in zip(parts, paths, strict=True) if name in part.values]
            if len(having) != 1:
                raise _not_in_one(name, having, paths)
            found[name] = next(part.values[name] for part in parts if name in part.values)
        return found

    def _branch(self, parts: Sequence[interface.ConfigPart], paths: Sequence[Path]) -> Branch:
        if not self.parameters.has_branch:
            return ()
        found = [(part.branch, path) for part, path in zip(parts, paths, strict=True) if part.branch]
        if len(found) != 1:
            raise _not_in_one("branch", [path for _, path in found], paths)
        return found[0][0]


def _corrections(
    parts: Sequence[interface.ConfigPart], paths: Sequence[Path]
) -> tuple[Corrections, Mapping[CorrectionKind, int]]:
    """All corrections, and which file has a place for each kind; raises ``FileError`` where two have it."""
    found, places = NO_CORRECTIONS, dict[CorrectionKind, int]()
    for kind in CorrectionKind:
        having = [place for place, one in enumerate(parts) if any(one.corrections.of(kind))]
        if len(having) > 1:
            raise _not_in_one(kind, [paths[place] for place in having], paths)
        able = [place for place, one in enumerate(parts) if kind in one.holds]
        for place in (having or able)[:1]:
            found = found.taking(parts[place].corrections, [kind])
            if place in able:
                places[kind] = place
    return found, places


def _require_places(wanted: Corrections, found: Corrections, places: Mapping[CorrectionKind, int]) -> None:
    """Refuse corrections that differ from those ``found`` and have no place in any file."""
    for kind in CorrectionKind:
        if kind not in places and wanted.of(kind) != found.of(kind):
            raise FileError(
                f"the controller's config has no place for corrections of {kind}",
                action="Nothing was written; name the file that has it in [[controller.further_files]]",
            )


def _not_in_one(name: str, having: Sequence[Path], paths: Sequence[Path]) -> FileError:
    if having:
        return FileError(
            f"{name} is in {having[0].name} and in {having[1].name}; which of them counts is not known",
            subject=having[1],
            action="Remove it from one of them, or give it another name in the config_options of one",
        )
    searched = " and ".join(path.name for path in paths)
    return FileError(
        f"{name} is in none of the files {searched}",
        subject=paths[0],
        action="Name the file that has it in [[controller.further_files]], or correct config_options",
    )


def controller_geometry(cell: Cell, *paths: Path) -> interface.ControllerGeometry:
    """What a cell's config states, or a copy of its files; with the limits of the INI file of the cell.

    Raises:
        FileError: one of the files is absent, or does not hold what it should.
    """
    found = ConfigLayout.of(cell.settings).read(*(paths or cell.config_paths))
    if (ini := cell.settings.limits.ini) is None:
        return found
    limits = limits_of_ini(cell.path.parent / ini, cell.settings.controller.unit_mm)
    return replace(found, limits=found.limits.narrowed(limits))


class CurrentConfig:
    """The config that a controller is to run; parsed again when its content has changed."""

    def __init__(self, paths: tuple[Path, ...], layout: ConfigLayout) -> None:
        self._paths = paths
        self._layout = layout
        self._parsed: tuple[str, interface.ControllerGeometry] | None = None

    @property
    def path(self) -> Path:
        """The config, or its first file, which stands for it in messages."""
        return self._paths[0]

    def geometry(self) -> interface.ControllerGeometry:
        """The geometry that it states now; raises ``FileError``."""
        now = fingerprint(*self._paths)
        if self._parsed is None or self._parsed[0] != now:
            self._parsed = now, self._layout.read(*self._paths)
        return self._parsed[1]


Contents = tuple[bytes, ...]
"""What each file holds, in the order in which the cell file names them."""


def read_contents(paths: Iterable[Path]) -> Contents:
    """What the files hold now; raises ``FileError``."""
    return tuple(atomic_files.read_bytes(path) for path in paths)


def read_contents_if_present(paths: Iterable[Path]) -> Contents | None:
    """What the files hold now; None if one of them is not there."""
    found = [atomic_files.read_if_present(path) for path in paths]
    there = tuple(data for data in found if data is not None)
    return there if len(there) == len(found) else None


def fingerprint_of(contents: Contents) -> str:
    """The SHA-256 of a single file; of several that of their SHA-256s, in order, a line each."""
    each = [atomic_files.sha256(data) for data in contents]
    if len(each) == 1:
        return each[0]
    return atomic_files.sha256("".join(f"{one}\n" for one in each).encode())


def fingerprint(*paths: Path) -> str:
    """The fingerprint of a config, for the start of a run; raises ``FileError``."""
    return fingerprint_of(read_contents(paths))


def names_of(paths: Sequence[Path]) -> tuple[str, ...]:
    """What the files are called in text: their names, or more of their paths where these are the same."""
    names = tuple(path.name for path in paths)
    if len({*names}) == len(names):
        return names
    absolute = [path.absolute() for path in paths]
    common = os.path.commonpath([path.parent for path in absolute])
    return tuple(os.path.relpath(path, common) for path in absolute)


def are_same_files(some: Sequence[Path], others: Sequence[Path]) -> bool:
    """Whether two configs are the same files in the same order, links resolved."""
    return [os.path.realpath(path) for path in some] == [os.path.realpath(path) for path in others]
