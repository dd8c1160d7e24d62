"""The native controller config: TOML with the geometry in ``[geometry]``, and whatever else.

    [geometry]
    S = [[x, y, z], ...]    # six joints on the sliders, base frame, mm
    B = [[x, y, z], ...]    # six joints on the platform, platform frame, mm
    l = [...]               # six leg lengths, mm
    branch = [1, ...]       # six signs

The file belongs to the robot's owner. A write-back changes the numbers of the geometry and no other
character.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from hexacell.controller_config.interface import Branch, ControllerGeometry
from hexacell.errors import FileError
from hexacell.kinematics.geometry import LEGS, Geometry
from hexacell.storage import atomic_files
from hexacell.storage.toml_document import TomlDocument
from hexacell.storage.toml_edit import replace_values
from hexacell.storage.toml_locations import KeyPath

_SHAPES: Mapping[str, tuple[int, ...]] = {"S": (LEGS, 3), "B": (LEGS, 3), "l": (LEGS,)}
_NEEDED = (
    "[geometry] needs S and B (six rows of three numbers, mm), l (six lengths, mm) and branch (six signs)"
)
_DECIMALS = 6
_HALF_A_NANOMETRE = 5e-7


class NativeToml:
    """The format ``toml``, a :class:`~hexacell.controller_config.interface.ConfigFormat`."""

    def read(self, path: Path) -> ControllerGeometry:
        """The geometry, mm, and the branch in the file.

        Raises:
            FileError: with file and line; also for a file that :meth:`rewrite` would refuse, so that this
                is known before anything is measured.
        """
        text = atomic_files.read_text(path)
        document = TomlDocument.parse(text, path)
        controller = ControllerGeometry(_geometry(document), _branch(document))
        replace_values(text, {}, path)
        return controller

    def rewrite(self, text: str, geometry: Geometry) -> str:
        """``text`` with ``geometry`` in it: six decimals (1 nm), no exponent.

        A value that differs by no more than half a nanometre keeps its token. The new text is read
        again before it is returned.

        Raises:
            FileError: ``text`` is no such config, or ``geometry`` has a value that is not finite or
                a leg that is not longer than zero.
        """
        _require_physical(geometry)
        before = _geometry(TomlDocument.parse(text))
        changed = replace_values(text, dict(_changed_tokens(before, geometry)))
        after = _geometry(TomlDocument.parse(changed))
        if after.largest_difference(geometry) > 2 * _HALF_A_NANOMETRE:
            raise FileError(
                "the new geometry does not read back as it was written",
                action="Nothing was written; please report this with the config",
            )
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


def _changed_tokens(before: Geometry, after: Geometry) -> Iterator[tuple[KeyPath, str]]:
    for name in _SHAPES:
        for index, new in np.ndenumerate(getattr(after, name)):
            if abs(new - getattr(before, name)[index]) > _HALF_A_NANOMETRE:
                yield ("geometry", name, *index), number_token(new)


def _geometry(document: TomlDocument) -> Geometry:
    """The geometry, mm; raises ``FileError`` with the line where it is not that."""
    arrays = {name: _numbers(document, _path_to(document, name), shape) for name, shape in _SHAPES.items()}
    for leg, length in enumerate(arrays["l"]):
        if length <= 0:
            problem = f"leg {leg + 1} is {length} mm long, but must be longer than zero"
            raise document.error(("geometry", "l", leg), problem, _NEEDED)
    return Geometry(**arrays)


def _branch(document: TomlDocument) -> Branch:
    """The signs, in ``[geometry]`` or at the top of the file; raises ``FileError``."""
    path = ("branch",) if "branch" in document.data else _path_to(document, "branch")
    signs = _numbers(document, path, (LEGS,))
    for leg, sign in enumerate(signs):
        if sign not in {1, -1}:
            raise _mismatch(document, (*path, leg), "1 or -1")
    return cast("Branch", tuple(int(sign) for sign in signs))


def _path_to(document: TomlDocument, name: str) -> KeyPath:
    if "geometry" not in document.data:
        raise document.error((), "there is no [geometry]", _NEEDED)
    if not isinstance(document.data["geometry"], dict):
        raise _mismatch(document, ("geometry",), "a section")
    if name not in document.data["geometry"]:
        raise document.error(("geometry",), f"[geometry] has no {name}", _NEEDED)
    return ("geometry", name)


def _numbers(document: TomlDocument, path: KeyPath, shape: tuple[int, ...]) -> Any:  # noqa: ANN401
    """The number, or the nested lists of numbers, of that shape at ``path``."""
    if not shape:
        return _number(document, path)
    value = document.value(path)
    if not isinstance(value, list) or len(value) != shape[0]:
        item = "rows" if shape[1:] else "numbers"
        raise _mismatch(document, path, f"a list of {shape[0]} {item}")
    return [_numbers(document, (*path, index), shape[1:]) for index in range(shape[0])]


def _number(document: TomlDocument, path: KeyPath) -> float:
    value = document.value(path)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _mismatch(document, path, "a number")
    if not abs(value) <= sys.float_info.max:  # NaN too, and integers of hundreds of digits
        raise _mismatch(document, path, "a finite number")
    return float(value)


def _mismatch(document: TomlDocument, path: KeyPath, expected: str) -> FileError:
    return document.error(path, document.mismatch(path, expected), _NEEDED)
