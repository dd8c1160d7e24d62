"""The cell file as a whole, and the rules that span its sections."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.base import GeometryValues, Point, Positive, Section, SixNumbers
from hexacell.cell.devices import (
    ControllerSettings,
    EncoderSettings,
    GaugeSettings,
    LimitSettings,
    NoiseSettings,
    TimingSettings,
    ToleranceSettings,
)
from hexacell.cell.simulation import SimulationSettings


class RobotSettings(Section):
    """The mechanism and its drawing."""

    mechanism: str = Field("hexaglide", description="hexaglide, or one that a plug-in adds")
    nominal: GeometryValues = Field(description="the drawing: where identification starts")


class IdentificationSettings(Section):
    """Where the geometry is measured."""

    points: tuple[Point, ...] = Field(min_length=2, description="ball positions, mm, in this order")
    orientations: int = Field(11, ge=2, description="records at each point, its reference included")
    seed: int = Field(1, ge=0, description="of the candidate orientations")


class VerificationSettings(Section):
    """Where the result is judged, on poses that take no part in the fit."""

    points: tuple[Point, ...] = Field(min_length=1, description="ball positions, mm")
    orientations: int = Field(6, ge=2, description="poses at each point, its reference included")
    seed: int = Field(2, ge=0, description="of the held-out orientations")


class AcceptanceSettings(Section):
    """When a result is good, and who lets it into the controller."""

    mean_deviation_mm: Positive = Field(0.05, description="at held-out points, after")
    max_deviation_mm: Positive = Field(0.15, description="at held-out points, after")
    largest_change_mm: Positive = Field(15.0, description="of a parameter, applied without a person")
    approval: Literal["ask", "automatic"] = Field(
        "ask", description="automatic: apply within the limits above without asking"
    )


class StationSettings(Section):
    """How the gauges get to each point."""

    placement: Literal["by-hand", "fixed"] = Field(
        "by-hand", description="fixed: gauges are in place at every point without a person"
    )


class TaskSettings(Section):
    """What the robot is for: poses at which its predicted accuracy is stated."""

    poses: tuple[SixNumbers, ...] = Field((), description="x y z a b c, mm and deg")


class CellSettings(Section):
    """A whole cell file."""

    version: Literal[1] = Field(1, description="of this file's format")
    name: str = Field(min_length=1)
    robot: RobotSettings
    controller: ControllerSettings
    gauges: tuple[GaugeSettings, GaugeSettings, GaugeSettings]
    encoders: EncoderSettings
    stations: StationSettings = StationSettings()
    tolerances: ToleranceSettings = ToleranceSettings()
    noise: NoiseSettings = NoiseSettings()
    limits: LimitSettings = LimitSettings()
    timing: TimingSettings = TimingSettings()
    identification: IdentificationSettings
    verification: VerificationSettings
    acceptance: AcceptanceSettings = AcceptanceSettings()
    task: TaskSettings = TaskSettings()
    simulation: SimulationSettings | None = None

    @model_validator(mode="after")
    def _devices_make_a_triad(self) -> Self:
        if sorted(gauge.axis for gauge in self.gauges) != ["x", "y", "z"]:
            raise ValueError("the three gauges must measure x, y and z, one each")
        if len({gauge.name for gauge in self.gauges}) != 3:
            raise ValueError("two gauges have the same name")
        if len(set(self.encoders.nodes)) != 6:
            raise ValueError("encoders.nodes must name six different node ids")
        return self

    @model_validator(mode="after")
    def _devices_can_be_reached(self) -> Self:
        if self.simulation is not None:
            return self
        missing = [f"gauge {gauge.name}: port" for gauge in self.gauges if gauge.port is None]
        missing += ["encoders: bus"] if self.encoders.bus is None else []
        missing += ["controller: port"] if self.controller.port is None else []
        if missing:
            raise ValueError("without a [simulation] section these are required: " + ", ".join(missing))
        return self
