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

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, ValidationInfo, create_model, field_validator

from hexacell.cell.by_mechanism import array_type
from hexacell.cell.fields import InRange, broken_rule, key, outside
from hexacell.config.interface import ConfigPart, ControllerLimits, write_number
from hexacell.config.layout import ConfigLayout, FormatOfFile
from hexacell.config.toml_corrections import OfOwner, WithCorrections, validated, with_corrections
from hexacell.errors import UsageError
from hexacell.kinematics.corrections import CorrectionKind, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.parameters import ParameterSet
from hexacell.storage.toml_document import KeyPath, TomlDocument


class NativeToml:
    """The format ``toml``, a :class:`~hexacell.config.interface.ConfigFormat`.

    Raises:
        UsageError: options are given; it has none.
    """

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
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
        there, found = self._content(TomlDocument.parse(text, source))
        vector = Geometry.of(there, found["geometry"]).vector.tolist() if there.kinds else []
        branch: Branch | None = None if self._is_part else ()
        if there.has_branch:
            branch = found.get("branch") or found["geometry"]["branch"]
        axes = tuple((axis["min"], axis["max"]) for axis in found.get("axes", ()))
        return ConfigPart(
            dict(zip(there.names, vector, strict=True)),
            branch,
            ControllerLimits(joints=axes or None),
            Corrections(**found["corrections"]),
            frozenset(CorrectionKind),
        )

    def rewrite(
        self, text: str, values: Mapping[str, float], corrections: Corrections | None = None
    ) -> str:
        """``text`` with these values of all its parameters, and with these corrections, if any.

        They have as many decimals as the unit has (1 nm), no exponent. A value that differs by no more than
        half of the last decimal keeps its token.
        """
        document = TomlDocument.parse(text)
        (there, found), tokens = self._content(document), dict[KeyPath, str]()
        if there.kinds:
            before = Geometry.of(there, found["geometry"])
            after = Geometry(there, [values[name] for name in there.names])
            for kind in there.kinds:
                old, decimals = before[kind.symbol], kind.unit.decimals
                for index, new in np.ndenumerate(after[kind.symbol]):
                    if abs(new - old[index]) > 0.5 * 10.0**-decimals:
                        tokens["geometry", kind.symbol, *index] = write_number(float(new), decimals)
        changed = document.replaced(tokens)
        return changed if corrections is None else with_corrections(changed, corrections)

    def _content(self, document: TomlDocument) -> tuple[ParameterSet, dict[str, Any]]:
        """The parameters that a document must have, and what it holds."""
        there, data = self._parameters, document.data
        if self._is_part:
            section = data.get("geometry")
            names = {*section} if isinstance(section, dict) else set()
            has_branch = there.has_branch and "branch" in names | {*data}
            there = ParameterSet(tuple(kind for kind in there.kinds if kind.symbol in names), has_branch)
        model = _model(
            there, branch_on_top="branch" in data, has_ranges=_has_ranges(data.get("axes"), there.legs)
        )
        return there, validated(document, model).model_dump()


def native_layout(parameters: ParameterSet) -> ConfigLayout:
    """The layout of a config that is one file in this format."""
    return ConfigLayout(parameters, (FormatOfFile("toml", NativeToml(parameters, {})),))


def _has_ranges(axes: object, legs: int) -> bool:
    """Whether the axes all state their range; otherwise they are the owner's own."""
    return (
        isinstance(axes, list)
        and len(axes) == legs
        and all(isinstance(axis, dict) and {"min", "max"} <= axis.keys() for axis in axes)
    )


def _a_sign(value: float) -> int:
    if value not in {1.0, -1.0}:
        raise outside("1 or -1")
    return int(value)


Sign = Annotated[InRange, AfterValidator(_a_sign)]


class _Axis(OfOwner):
    """The range of a joint variable."""

    min: InRange
    max: InRange

    @field_validator("max")
    @classmethod
    def _is_above_min(cls, value: float, info: ValidationInfo) -> float:
        if (low := info.data.get("min")) is not None and low >= value:
            raise broken_rule(f"max of this axis is not above its min, {low:g}", "Correct one of them")
        return value


@cache
def _model(parameters: ParameterSet, *, branch_on_top: bool, has_ranges: bool) -> type[WithCorrections]:
    """The model of such a file; the signs are in ``[geometry]`` or at its top."""
    geometry: dict[str, Any] = {
        kind.symbol: (array_type(kind), key(..., kind.meaning)) for kind in parameters.kinds
    }
    legs = parameters.legs
    ranges: Any = tuple.__class_getitem__((_Axis,) * legs)
    signs: Any = tuple.__class_getitem__((Sign,) * legs)
    whole: dict[str, Any] = {"axes": (ranges, ...)} if has_ranges else {}
    if parameters.has_branch:
        place = whole if branch_on_top else geometry
        place["branch"] = (signs, key(..., "signs: the solution of the inverse kinematics of each leg"))
    if geometry:
        whole["geometry"] = (create_model("Geometry", __base__=OfOwner, **geometry), ...)
    return create_model("NativeConfig", __base__=WithCorrections, **whole)
