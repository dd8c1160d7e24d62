"""Limits of joints and axes in LinuxCNC's INI file: ``[JOINT_0] MIN_LIMIT``, ``[AXIS_X] MAX_LIMIT``."""

from __future__ import annotations

from pathlib import Path

from hexacell.cell.fields import LARGEST_NUMBER
from hexacell.config.ini_text import IniText
from hexacell.config.interface import LARGEST_CONFIG_BYTES, ControllerLimits, Range
from hexacell.config.keyed_config import NumberLookup
from hexacell.config.number_tokens import NumberToken, number_of, token_error
from hexacell.kinematics.parameters import LEGS
from hexacell.storage import atomic_files

LINEAR, ANGULAR = "XYZ", "ABC"
ROTARY_JOINT = "ANGULAR"


def limits_of_ini(path: Path, unit_mm: float = 1.0) -> ControllerLimits:
    """The limits in an INI file, in mm and deg; of axes and joints that are not all there: none.

    ``unit_mm`` is one unit of length of the machine; angles are in degrees on every machine.

    Raises:
        FileError: the file cannot be read, or a limit is no number, or not above the other.
    """
    text = IniText(atomic_files.read_text(path, LARGEST_CONFIG_BYTES), path, "")
    return limits_in(text, path, unit_mm)


def limits_in(ini: NumberLookup, source: Path | None, unit_mm: float) -> ControllerLimits:
    """The same of a text that was read from ``source``."""
    joints = [
        _range(ini, section, 1.0 if _turns(ini, section) else unit_mm, source)
        for section in (f"JOINT_{leg}" for leg in range(LEGS))
    ]
    axes = [
        *(_range(ini, f"AXIS_{axis}", unit_mm, source) for axis in LINEAR),
        *(_range(ini, f"AXIS_{axis}", 1.0, source) for axis in ANGULAR),
    ]
    stated = [one for one in joints if one is not None]
    return ControllerLimits(
        joints=tuple(stated) if len(stated) == LEGS else None, axes=tuple(axes) if any(axes) else None
    )


def _turns(ini: NumberLookup, joint: str) -> bool:
    """Whether a joint is one of angles; without ``TYPE`` LinuxCNC takes it for one of lengths."""
    key = f"{joint}/TYPE"
    return ini.has(key) and ini.number(key).text.upper() == ROTARY_JOINT


def _range(ini: NumberLookup, section: str, unit: float, source: Path | None) -> Range | None:
    """Both limits of a joint or an axis; LinuxCNC takes one that is not there for none."""
    low, high = (_limit(ini, f"{section}/{name}", source) for name in ("MIN_LIMIT", "MAX_LIMIT"))
    if low is None and high is None:
        return None
    lowest = -LARGEST_NUMBER if low is None else unit * low.value
    highest = LARGEST_NUMBER if high is None else unit * high.value
    if low is not None and high is not None and lowest >= highest:
        problem = f"MAX_LIMIT of [{section}] is not above its MIN_LIMIT, {low.text}"
        raise token_error(high, problem, source, "Correct one of them")
    return lowest, highest


def _limit(ini: NumberLookup, key: str, source: Path | None) -> NumberToken | None:
    if not ini.has(key):
        return None
    token = ini.number(key)
    number_of(token, source)
    return token
