"""The config format ``linuxcnc-ini``: variables of LinuxCNC's INI file, or of a file that it includes.

    [HEXAGLIDE]
    S1X = -400.0
    ...
    L6 = 700.0

HAL reads them by ``setp hexaglidekins.s1x [HEXAGLIDE]S1X``. Limits of joints and axes in the
same file hold as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from hexacell.cell.fields import Text
from hexacell.config.ini_text import IniText
from hexacell.config.keyed_config import KeyedConfig, KeyedOptions, NumberKeys, options_of
from hexacell.config.linuxcnc_limits import limits_in
from hexacell.kinematics.parameters import ParameterSet


class LinuxcncIniOptions(KeyedOptions):
    """Options of the format; ``section`` is where the variables without a section of their own are."""

    section: Text = Field("GEOMETRY", min_length=1)


class LinuxcncIni(KeyedConfig):
    """A :class:`~hexacell.config.interface.ConfigFormat`; raises ``UsageError`` for options."""

    def __init__(
        self, parameters: ParameterSet, given: Mapping[str, Any], *, is_part: bool = False
    ) -> None:
        options = options_of(LinuxcncIniOptions, "linuxcnc-ini", given)
        keys = NumberKeys.of(parameters, options, lambda parameter: parameter.name.upper(), is_part=is_part)
        super().__init__(
            parameters,
            keys,
            lambda text, path: IniText(text, path, options.section),
            options.unit_mm,
            lambda text, path: limits_in(text, path, options.unit_mm),
        )
