"""The cell file as a whole, and the rules that span its sections."""

from __future__ import annotations

from functools import cache
from typing import Literal, Self

from pydantic import Field, ValidationError, create_model, field_validator, model_validator
from pydantic_core import InitErrorDetails

from hexacell.cell.calibration import (
    AcceptanceSettings,
    IdentificationSettings,
    StationSettings,
    TaskSettings,
    VerificationSettings,
)
from hexacell.cell.devices import ControllerSettings, EncoderSettings, GaugeSettings, ThermometerSettings
from hexacell.cell.fields import Section, broken_rule
from hexacell.cell.limits import (
    GuardSettings,
    LimitSettings,
    NoiseSettings,
    TimingSettings,
)
from hexacell.cell.mechanism_sections import (
    DEFAULT_MECHANISM,
    GeometrySettings,
    ToleranceSettings,
    geometry_settings,
    mechanism_named,
    tolerance_settings,
)
from hexacell.cell.recovery import RecoverySettings
from hexacell.cell.simulation import SimulationSettings


class RobotSettings(Section):
    """The mechanism and its drawing."""

    mechanism: str = Field(DEFAULT_MECHANISM, description="hexaglide, or one that a plug-in adds")
    nominal: GeometrySettings = Field(description="the drawing; identification starts from it")


class CellSettings(Section):
    """A whole cell file, for any mechanism; :func:`cell_model` is the model of one."""

    version: Literal[1] = Field(1, description="of this file's format")
    name: str = Field(min_length=1, description="of the cell, on screens and in reports")
    robot: RobotSettings
    controller: ControllerSettings
    gauges: tuple[GaugeSettings, GaugeSettings, GaugeSettings]
    encoders: EncoderSettings
    thermometers: tuple[ThermometerSettings, ...] = ()
    stations: StationSettings = StationSettings()
    tolerances: ToleranceSettings = ToleranceSettings()
    noise: NoiseSettings = NoiseSettings()
    limits: LimitSettings = LimitSettings()
    timing: TimingSettings = TimingSettings()
    guards: GuardSettings = GuardSettings()
    identification: IdentificationSettings
    verification: VerificationSettings
    acceptance: AcceptanceSettings = AcceptanceSettings()
    recovery: RecoverySettings = RecoverySettings()
    task: TaskSettings = TaskSettings()
    simulation: SimulationSettings | None = None

    @field_validator("gauges")
    @classmethod
    def _gauges_make_a_triad(cls, gauges: tuple[GaugeSettings, ...]) -> tuple[GaugeSettings, ...]:
        if sorted(gauge.axis for gauge in gauges) != ["x", "y", "z"]:
            raise broken_rule("the three gauges must measure x, y and z, one each", "Correct their axis")
        if len({gauge.name for gauge in gauges}) != 3:
            raise broken_rule("two gauges have the same name", "Give each another name")
        inputs = [(gauge.port, gauge.channel) for gauge in gauges if gauge.port is not None]
        if len(set(inputs)) != len(inputs):
            raise broken_rule("two gauges have the same port and channel", "Correct one of them")
        return gauges

    @field_validator("thermometers")
    @classmethod
    def _thermometers_differ(
        cls, thermometers: tuple[ThermometerSettings, ...]
    ) -> tuple[ThermometerSettings, ...]:
        if len({thermometer.name for thermometer in thermometers}) != len(thermometers):
            raise broken_rule("two thermometers have the same name", "Give each another name")
        return thermometers

    @model_validator(mode="after")
    def _real_devices_can_be_reached(self) -> Self:
        """Each missing connection is refused at its own place, which gives the error its line."""
        if self.simulation is not None:
            return self
        connections: list[tuple[tuple[str | int, ...], str, object]] = [
            *((("gauges", n), "the gauge has no port", gauge.port) for n, gauge in enumerate(self.gauges)),
            (("encoders",), "the encoders have no bus", self.encoders.bus),
            (("controller",), "the controller has no port", self.controller.port),
        ]
        refusals = [_unreachable(place, problem) for place, problem, given in connections if given is None]
        if refusals:
            raise ValidationError.from_exception_data(self.name, refusals)
        return self


@cache
def cell_model(mechanism: str) -> type[CellSettings]:
    """The model of the cell files of one mechanism, whose parameters decide some of the keys.

    Raises:
        UsageError: no such mechanism is installed.
    """
    parameters = mechanism_named(mechanism).parameters
    geometry, tolerances = geometry_settings(parameters), tolerance_settings(parameters)
    has_defaults = not any(field.is_required() for field in tolerances.model_fields.values())
    nominal = (geometry, RobotSettings.model_fields["nominal"])
    truth = (geometry, SimulationSettings.model_fields["geometry"])
    robot = create_model(
        "RobotSettings", __base__=RobotSettings, __doc__=RobotSettings.__doc__, nominal=nominal
    )
    simulation = create_model(
        "SimulationSettings",
        __base__=SimulationSettings,
        __doc__=SimulationSettings.__doc__,
        geometry=truth,
    )
    return create_model(
        "CellSettings",
        __base__=CellSettings,
        __doc__="A whole cell file.",
        robot=(robot, ...),
        tolerances=(tolerances, tolerances() if has_defaults else ...),
        simulation=(simulation | None, None),
    )


def _unreachable(place: tuple[str | int, ...], problem: str) -> InitErrorDetails:
    rule = broken_rule(f"{problem}; only a cell with a [simulation] needs none", "Add it")
    return InitErrorDetails(type=rule, loc=place, input=None)
