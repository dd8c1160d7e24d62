"""The native controller config: TOML with the geometry in ``[geometry]``, and whatever else.

    [geometry]
    S = [[x, y, z], ...]    # six joints on the sliders, base frame, mm
    B = [[x, y, z], ...]    # six joints on the platform, platform frame, mm
    l = [...]               # six leg lengths, mm
    branch = [1, ...]       # six signs

The file belongs to the robot's owner. A write-back puts new number tokens into the places of old
ones and leaves every other character alone; TOML writers cannot promise that, so none is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from hexacell import files
from hexacell.controller_config.format import ControllerGeometry
from hexacell.controller_config.toml_geometry import TomlConfig
from hexacell.controller_config.toml_positions import KeyPath, Span
from hexacell.errors import FileError
from hexacell.geometry import Geometry

_DECIMALS = 6
_HALF_A_NANOMETRE = 5e-7


class NativeToml:
    """The format ``toml``, a :class:`~hexacell.controller_config.format.ConfigFormat`."""

    def read(self, path: Path) -> ControllerGeometry:
        """The geometry, mm, and the branch in the file; raises ``FileError`` with file and line."""
        config = TomlConfig.parse(files.read_text(path), path)
        return ControllerGeometry(config.geometry(), config.branch())

    def rewrite(self, text: str, geometry: Geometry) -> str:
        """``text`` with ``geometry`` in it: six decimals (1 nm), no exponent.

        A value that differs by no more than half a nanometre keeps its token. The new text is read
        again before it is given out.

        Raises:
            FileError: ``text`` is no such config, or ``geometry`` has a value that is not finite or
                a leg that is not longer than zero.
        """
        _require_physical(geometry)
        config = TomlConfig.parse(text)
        changed = _spliced(text, _replacements(config, geometry))
        _require_faithful(config, TomlConfig.parse(changed), geometry)
        return changed


def number_token(value: float) -> str:
    """``value`` as a TOML float: at most six decimals, at least one, never ``-0.0``."""
    whole, _, decimals = f"{value:.{_DECIMALS}f}".partition(".")
    number = f"{whole}.{decimals.rstrip('0') or '0'}"
    return "0.0" if number == "-0.0" else number


def _require_physical(geometry: Geometry) -> None:
    if not np.isfinite(geometry.vector()).all() or not (geometry.l > 0).all():
        raise FileError(
            "the new geometry has values that are not finite, or legs that are not longer than zero",
            action="Nothing was written; identify again",
        )


def _values(geometry: Geometry) -> Iterator[tuple[KeyPath, float]]:
    for name in ("S", "B", "l"):
        for place, value in np.ndenumerate(getattr(geometry, name)):
            yield ("geometry", name, *place), float(value)


def _replacements(config: TomlConfig, geometry: Geometry) -> Iterator[tuple[Span, str]]:
    pairs = zip(_values(config.geometry()), _values(geometry), strict=True)
    for (place, old), (_, new) in pairs:
        if abs(new - old) > _HALF_A_NANOMETRE:
            yield config.spans[place], number_token(new)


def _spliced(text: str, replacements: Iterator[tuple[Span, str]]) -> str:
    # From the end, so that the spans still to come keep their places.
    for span, token in sorted(replacements, key=lambda item: item[0].start, reverse=True):
        text = text[: span.start] + token + text[span.end :]
    return text


def _require_faithful(old: TomlConfig, new: TomlConfig, geometry: Geometry) -> None:
    written = new.geometry().largest_difference(geometry) <= 2 * _HALF_A_NANOMETRE
    if not written or _without_geometry(old) != _without_geometry(new):
        raise FileError(
            "the new geometry does not read back as it was written",
            action="Nothing was written; please report this with the config",
        )


def _without_geometry(config: TomlConfig) -> str:
    rest: dict[str, Any] = deepcopy(config.data)
    for name in ("S", "B", "l"):
        del rest["geometry"][name]
    # As text, because a NaN in somebody's own table does not equal itself.
    return repr(rest)
