"""The model of the cell files of one mechanism: keys of its parameters, and units of its joint variables.

The options of the controller are those of its protocol.

A field whose alias ends in the unit of the joint variables is in that unit: ``encoder`` is the key
``encoder_mm`` where joints slide, and ``encoder_deg`` where they turn. The sections are written for mm;
here they are derived for deg, with other keys and defaults, and nothing else changes.
"""

import re
from collections.abc import Mapping
from contextlib import suppress
from copy import copy
from functools import cache
from typing import Any, TypeVar

from pydantic import Field, ValidationError, create_model
from pydantic_core import PydanticUndefined

from hexacell.cell.devices import EncoderSettings, LinearEncoderSettings, RotaryEncoderSettings
from hexacell.cell.fields import GeometrySettings, InRange, NotNegative, Positive, Section, Text
from hexacell.cell.joint_count import for_joints
from hexacell.cell.limits import LimitSettings, SpeedSettings
from hexacell.cell.measuring import GuardSettings, NoiseSettings, TimingSettings
from hexacell.cell.model import CellSettings, ToleranceSettings
from hexacell.cell.robot import (
    ControllerOptions,
    ControllerSettings,
    RobotSettings,
    RotaryControllerSettings,
    mechanism_of,
)
from hexacell.cell.simulation import SimulatedEncoders, SimulatedJoints, SimulatedMotion, SimulationSettings
from hexacell.cell.uncertainty import (
    CommonUncertaintySettings,
    LinearUncertaintySettings,
    ModelSettings,
    RotaryUncertaintySettings,
    UncertaintySettings,
)
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import CONSTRAINTS, JointUnit, ParameterKind, ParameterSet

SectionType = TypeVar("SectionType", bound=Section)

IN_DEG: Mapping[type[Section], Mapping[str, float]] = {
    LimitSettings: {"joint_min": -180.0, "joint_max": 180.0},
    NoiseSettings: {"encoder": 0.003},
    SpeedSettings: {"joint": 30.0, "joint_at_gauges": 7.5},
    TimingSettings: {"spread_encoder": 0.02},
    ModelSettings: {"backlash": 0.03},
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
    return _derived(section, **fields)


@cache
def cell_model(
    mechanism: str, *, encoder_scales: bool, options: type[ControllerOptions] = ControllerOptions
) -> type[CellSettings]:
    """The model of the cell files of one mechanism and one controller.

    Each has one model only: settings of two would never be equal.

    Raises:
        UsageError: the mechanism is not installed.
    """
    found = mechanism_of(mechanism, encoder_scales=encoder_scales)
    parameters = found.parameters
    geometry, tolerances = geometry_settings(parameters), tolerance_settings(parameters)
    has_defaults = not any(field.is_required() for field in tolerances.model_fields.values())
    robot = _derived(RobotSettings, nominal=(geometry, RobotSettings.model_fields["nominal"]))
    truth = SimulationSettings.model_fields["geometry"]
    simulated = _in_unit(found, encoders=SimulatedEncoders, motion=SimulatedMotion, joints=SimulatedJoints)
    simulation = _derived(SimulationSettings, geometry=(geometry, truth), **simulated)
    encoders: type[EncoderSettings] = LinearEncoderSettings
    controller: type[ControllerSettings] = ControllerSettings
    uncertainty: type[CommonUncertaintySettings] = UncertaintySettings
    if found.words.joint_unit is JointUnit.DEG:
        encoders = in_joint_unit(RotaryEncoderSettings, JointUnit.DEG)
        controller, uncertainty = RotaryControllerSettings, RotaryUncertaintySettings
    elif found.words.guide is None:
        uncertainty = LinearUncertaintySettings
    if options is not ControllerOptions:
        controller = _derived(controller, options=_options_field(options))
    if found.joint_count < CONSTRAINTS:
        taken = copy(ControllerSettings.model_fields["coordinates"])
        taken.default = found.coordinates
        controller = _derived(controller, coordinates=(Text, taken))
    model = _derived(
        CellSettings,
        uncertainty=(uncertainty, uncertainty()),
        robot=(robot, ...),
        encoders=(encoders, ...),
        controller=(controller, ...),
        tolerances=(tolerances, tolerances() if has_defaults else ...),
        simulation=(simulation | None, None),
        **_in_unit(
            found,
            noise=NoiseSettings,
            limits=LimitSettings,
            speed=SpeedSettings,
            timing=TimingSettings,
            guards=GuardSettings,
            model=ModelSettings,
        ),
    )
    return model if found.joint_count == CONSTRAINTS else for_joints(model, found.joint_count)


def _options_field(options: type[ControllerOptions]) -> tuple[type[ControllerOptions], Any]:
    """A key of the controller's section, which may be left away if all options may."""
    field = copy(ControllerSettings.model_fields["options"])
    field.default = PydanticUndefined
    with suppress(ValidationError):  # some are needed
        field.default = options()
    return options, field


def _in_unit(mechanism: Mechanism, **sections: type[Section]) -> dict[str, Any]:
    made = {name: in_joint_unit(one, mechanism.words.joint_unit) for name, one in sections.items()}
    return {name: (one, one()) for name, one in made.items()}


def geometry_settings(parameters: ParameterSet) -> type[GeometrySettings]:
    """The section for a geometry of these parameters."""
    fields: dict[str, Any] = {}
    for kind in parameters.kinds:
        default = ... if kind.default is None else (kind.default,) * len(kind.owners)
        fields[kind.symbol] = (array_type(kind), Field(default, description=kind.meaning))
    return _derived(GeometrySettings, **fields)


def tolerance_settings(parameters: ParameterSet) -> type[ToleranceSettings]:
    """The section for the tolerances of these parameters."""
    fields: dict[str, Any] = {}
    for kind in parameters.kinds:
        default = ... if kind.default_tolerance is None else kind.default_tolerance
        fields[kind.tolerance_key] = (Positive, Field(default, description=kind.tolerance_meaning))
    kinds = " and ".join(kind.symbol for kind in parameters.kinds if kind.has_ball_offset)
    description = f"mounting of the ball: an offset common to all {kinds}"
    fields["ball_mm"] = (NotNegative, Field(0.0, description=description))
    return _derived(ToleranceSettings, **fields)


def array_type(kind: ParameterKind) -> Any:  # noqa: ANN401 - a type made here
    """The type of all numbers of a kind: its rows, or numbers."""
    made: Any = Positive if kind.is_positive else InRange
    for length in reversed(kind.shape):
        made = tuple.__class_getitem__((made,) * length)
    return made


def _derived(base: type[SectionType], /, **fields: Any) -> type[SectionType]:  # noqa: ANN401
    """A section with the fields that the mechanism decides; each is a type and a default or description."""
    return create_model(base.__name__, __base__=base, __doc__=base.__doc__, **fields)
