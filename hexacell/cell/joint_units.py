"""Sections of the cell file of a mechanism whose joint variables are angles.

A field whose alias ends in the unit of the joint variables is in that unit: ``encoder`` is the key
``encoder_mm`` where joints slide, and ``encoder_deg`` where they turn. The sections are written for mm;
here they are derived for deg, with other keys and defaults, and nothing else changes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from copy import copy
from typing import Any, TypeVar

from pydantic import create_model

from hexacell.cell.fields import Section
from hexacell.cell.limits import LimitSettings
from hexacell.cell.measuring import GuardSettings, NoiseSettings, TimingSettings
from hexacell.cell.simulation import SimulatedEncoders, SimulatedMotion
from hexacell.cell.speed import SpeedSettings
from hexacell.kinematics.parameters import JointUnit

SectionType = TypeVar("SectionType", bound=Section)

IN_DEG: Mapping[type[Section], Mapping[str, float]] = {
    LimitSettings: {"joint_min": -180.0, "joint_max": 180.0},
    NoiseSettings: {"encoder": 0.003},
    SpeedSettings: {"joint": 30.0, "joint_at_gauges": 7.5},
    TimingSettings: {"spread_encoder": 0.02},
    GuardSettings: {"following": 0.3},
    SimulatedEncoders: {"noise": 0.003, "flicker": 0.0003},
    SimulatedMotion: {"speed": 30.0},
}
"""Defaults for joints that turn: what the defaults in mm are at a radius of some 200 mm."""

OF_MM = re.compile(r"_mm(?=$|_s$)")


def in_joint_unit(section: type[SectionType], unit: JointUnit) -> type[SectionType]:
    """The section whose keys and defaults are for joint variables of a unit."""
    if unit is JointUnit.MM:
        return section
    defaults = next((found for of, found in IN_DEG.items() if issubclass(section, of)), {})
    fields: dict[str, Any] = {}
    for name, of_mm in section.model_fields.items():
        if of_mm.alias is None:
            continue
        field = copy(of_mm)
        field.alias = field.validation_alias = field.serialization_alias = OF_MM.sub("_deg", of_mm.alias)
        field.default = defaults.get(name, of_mm.default)
        fields[name] = (of_mm.annotation, field)
    made: type[SectionType] = create_model(
        section.__name__, __base__=section, __doc__=section.__doc__, **fields
    )
    return made
