"""The native controller config: TOML with the geometry in ``[geometry]``, and whatever else.

    [geometry]
    S = [[x, y, z], ...]    # six joints on the sliders, base frame, mm
    B = [[x, y, z], ...]    # six joints on the platform, platform frame, mm
    l = [...]               # six leg lengths, mm
    branch = [1, ...]       # six signs; of a mechanism whose legs have two inverse solutions

    [[axes]]                # six sliders or none; the joint variable's range, which may be absent
    min = -800.0
    max = 200.0

and ``[corrections]`` (:mod:`~hexacell.config.toml_corrections`). The file belongs to the robot's owner. A
write-back changes the numbers of the geometry and of the corrections, and no other character.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from hexacell.cell.fields import LARGEST_NUMBER
from hexacell.config.interface import ConfigPart, ControllerLimits, JointRanges, write_number
from hexacell.config.layout import ConfigLayout, FormatOfFile
from hexacell.config.toml_corrections import read_corrections, with_corrections
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.corrections import CorrectionKind, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.parameters import LEGS, ParameterKind, ParameterSet
from hexacell.storage.toml_document import KeyPath, TomlDocument


class NativeToml:
    """The format ``toml``, a :class:`~hexacell.config.interface.ConfigFormat`.

    Raises:
        UsageError: options are given; it has none.
    """

    holds = frozenset(CorrectionKind)

    def __init__(
        self,
        parameters: ParameterSet,
        given: Mapping[str, Any] = MappingProxyType({}),
        *,
        is_part: bool = False,
    ) -> None:
        if given:
            raise UsageError(
                f"the config format 'toml' has no options, but '{next(iter(given))}' is given",
                action="Remove [controller.config_options], or name another config_format",
            )
        self._parameters = parameters
        self._is_part = is_part

    def read(self, text: str, source: Path | None) -> ConfigPart:
        """All parameters, or the kinds that ``[geometry]`` has; raises ``FileError`` with the line."""
        content = self._content(TomlDocument.parse(text, source))
        there = content.parameters
        vector = content.geometry().vector.tolist() if there.kinds else []
        return ConfigPart(
            dict(zip(there.names, vector, strict=True)),
            content.branch() if there.has_branch or not self._is_part else None,
            ControllerLimits(joints=content.joint_ranges()),
            read_corrections(content.document),
            self.holds,
        )

    def rewrite(
        self, text: str, values: Mapping[str, float], corrections: Corrections | None = None
    ) -> str:
        """``text`` with these values of all its parameters, and with these corrections, if any.

        They have as many decimals as the unit has (1 nm), no exponent. A value that differs by no more than
        half of the last decimal keeps its token.
        """
        content = self._content(TomlDocument.parse(text))
        there, tokens = content.parameters, dict[KeyPath, str]()
        if there.kinds:
            before, after = content.geometry(), Geometry(there, [values[name] for name in there.names])
            for kind in there.kinds:
                old, half_of_last = before[kind.symbol], 0.5 * 10.0**-kind.unit.decimals
                for index, new in np.ndenumerate(after[kind.symbol]):
                    if abs(new - old[index]) > half_of_last:
                        tokens["geometry", kind.symbol, *index] = write_number(
                            float(new), kind.unit.decimals
                        )
        changed = content.document.replaced(tokens)
        return changed if corrections is None else with_corrections(changed, corrections)

    def _content(self, document: TomlDocument) -> _Content:
        if not self._is_part:
            return _Content(document, self._parameters)
        section = document.data.get("geometry")
        names = {*section} if isinstance(section, dict) else set()
        has_branch = self._parameters.has_branch and "branch" in names | {*document.data}
        kinds = tuple(kind for kind in self._parameters.kinds if kind.symbol in names)
        return _Content(document, ParameterSet(kinds, has_branch))


def native_layout(parameters: ParameterSet) -> ConfigLayout:
    """The layout of a config that is one file in this format."""
    return ConfigLayout(parameters, (FormatOfFile("toml", NativeToml(parameters)),))


@dataclass(frozen=True, slots=True)
class _Content:
    """The content of a config; every method raises ``FileError`` with the line of what is wrong."""

    document: TomlDocument
    parameters: ParameterSet

    def geometry(self) -> Geometry:
        """The geometry, in the units of its parameters."""
        kinds = self.parameters.kinds
        values = {kind.symbol: self._numbers(self._path_to(kind.symbol), kind.shape) for kind in kinds}
        for kind in kinds:
            if kind.is_positive:
                self._require_positive(kind, values[kind.symbol])
        return Geometry.of(self.parameters, values)

    def branch(self) -> Branch:
        """The signs, in ``[geometry]`` or at the top of the file; empty for a mechanism without."""
        if not self.parameters.has_branch:
            return ()
        path = ("branch",) if "branch" in self.document.data else self._path_to("branch")
        signs = self._numbers(path, (LEGS,))
        for leg, sign in enumerate(signs):
            if sign not in {1, -1}:
                raise self._mismatch((*path, leg), "1 or -1")
        return cast("Branch", tuple(int(sign) for sign in signs))

    def joint_ranges(self) -> JointRanges | None:
        """Smallest and largest joint variable of each leg; None where the six are not all stated."""
        axes = self.document.data.get("axes")
        if not isinstance(axes, list) or len(axes) != LEGS:
            return None
        if not all(isinstance(axis, dict) and {"min", "max"} <= axis.keys() for axis in axes):
            return None
        ranges: list[tuple[float, float]] = []
        for leg in range(LEGS):
            low, high = (self._number(("axes", leg, limit)) for limit in ("min", "max"))
            if low >= high:
                problem = f"max of axis {leg + 1} is not above its min, {low:g}"
                raise self._error(("axes", leg, "max"), problem)
            ranges.append((low, high))
        return tuple(ranges)

    def _require_positive(self, kind: ParameterKind, values: Any) -> None:  # noqa: ANN401
        for index, value in np.ndenumerate(np.array(values)):
            if value <= 0.0:
                component = kind.components[index[1]] if kind.components else ""
                name = kind.display_name(index[0] + 1, component)
                problem = f"{name} is {value} {kind.unit}, but must be above zero"
                raise self._error(("geometry", kind.symbol, *index), problem)

    def _path_to(self, name: str) -> KeyPath:
        data = self.document.data
        if "geometry" not in data:
            raise self._error((), "there is no [geometry]")
        if not isinstance(data["geometry"], dict):
            raise self._mismatch(("geometry",), "a section")
        if name not in data["geometry"]:
            raise self._error(("geometry",), f"[geometry] has no {name}")
        return ("geometry", name)

    def _numbers(self, path: KeyPath, shape: tuple[int, ...]) -> Any:  # noqa: ANN401
        if not shape:
            return self._number(path)
        value = self.document.value(path)
        if not isinstance(value, list) or len(value) != shape[0]:
            item = "rows" if shape[1:] else "numbers"
            raise self._mismatch(path, f"a list of {shape[0]} {item}")
        return [self._numbers((*path, index), shape[1:]) for index in range(shape[0])]

    def _number(self, path: KeyPath) -> float:
        value = self.document.value(path)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._mismatch(path, "a number")
        if not abs(value) <= LARGEST_NUMBER:  # NaN too, and integers of hundreds of digits
            raise self._mismatch(path, f"a finite number within +-{LARGEST_NUMBER:g}")
        return float(value)

    def _mismatch(self, path: KeyPath, expected: str) -> FileError:
        return self._error(path, self.document.mismatch(path, expected))

    def _error(self, path: KeyPath, problem: str) -> FileError:
        needed: list[str] = []  # as "S (six rows of 3 numbers, mm)"
        for kind in self.parameters.kinds:
            values = f"six rows of {len(kind.components)} numbers" if kind.components else "six numbers"
            needed.append(f"{kind.symbol} ({', '.join(filter(None, (values, kind.unit)))})")
        if self.parameters.has_branch:
            needed.append("branch (six signs)")
        *most, last = needed
        return self.document.error(path, problem, f"[geometry] needs {', '.join(most)} and {last}")
