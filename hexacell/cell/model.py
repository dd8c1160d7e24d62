"""The cell file as a whole, and the rules that span its sections.

The section of the cell file that says when motion is stopped, and how a person forbids it.

The section of the cell file that names a thermometer.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_core import InitErrorDetails

from hexacell.cell.devices import (
    ControllerSettings,
    EncoderSettings,
    GaugeSettings,
    LimitSettings,
    NoiseSettings,
    TimingSettings,
    ToleranceSettings,
)
from hexacell.cell.fields import (
    GeometryValues,
    NotNegative,
    Point,
    Positive,
    Section,
    SixNumbers,
    broken_rule,
)
from hexacell.cell.recovery import RecoverySettings
from hexacell.cell.simulation import SimulationSettings


class GuardSettings(Section):
    """Limits beyond which nothing moves on; most others are in [limits] and [acceptance]."""

    stop_file: str | None = Field(
        None, description="while this file exists nothing moves; relative to the cell file"
    )
    stop_port: str | None = Field(
        None, description="serial port of a stop contact, closed while motion is allowed"
    )
    stop_contact: Literal["dsr", "cts"] = Field(
        "dsr", description="dsr: the contact joins DTR and DSR of stop_port, cts: RTS and CTS"
    )
    stale_s: Positive = Field(
        0.12, description="longest a watched device may stay silent while the robot moves, on the wall"
    )
    plate_margin_mm: NotNegative = Field(
        0.5, description="beyond limits.gauge_travel_mm, for the ball's swing while it moves"
    )
    following_mm: Positive = Field(
        1.0, description="largest difference of a slider from where the controller was told to send it"
    )
    free_disk_mb: NotNegative = Field(50.0, description="least free space where the run is kept, MB")


class ThermometerSettings(Section):
    """A thermometer at the machine or in the room; its readings are kept with every record."""

    name: str = Field(min_length=1, description="where it is: room, rails, platform")
    protocol: str = Field("sysfs", description="sysfs, or one that a plug-in adds")
    path: str = Field(
        min_length=1,
        description="sysfs: the file with the temperature in millidegrees, such as "
        "/sys/bus/w1/devices/28-.../temperature",
    )
    timeout_s: Positive = Field(2.0, description="longest wait for a reading")


class RobotSettings(Section):
    """The mechanism and its drawing."""

    mechanism: str = Field("hexaglide", description="hexaglide, or one that a plug-in adds")
    nominal: GeometryValues = Field(description="the drawing: where identification starts")


class IdentificationSettings(Section):
    """Where the geometry is measured."""

    points: tuple[Point, ...] = Field(min_length=2, description="ball positions, mm, in this order")
    orientations: int = Field(11, ge=2, description="records at each point, its reference included")
    seed: int = Field(1, ge=0, description="of the candidate orientations")
    criterion: Literal["task", "parameters", "information"] = Field(
        "information",
        description="what a pose is chosen for: error at the task poses, of all parameters, or bits",
    )
    target_mm: Positive | None = Field(
        None, description="done once the predicted error at every task pose is below, 1 sigma"
    )
    least_gain_mm: NotNegative = Field(
        0.0, description="done once no record would lower that error by more"
    )
    budget_records: int | None = Field(None, ge=2, description="records at most, references included")
    budget_minutes: Positive | None = Field(None, description="estimated time at most")
    minutes_per_station: NotNegative = Field(
        5.0, description="to carry the gauges to a point by hand and place them"
    )
    seconds_per_record: Positive | None = Field(
        None, description="to move and settle; by default from [timing]"
    )
    choose_points: bool = Field(
        False, description="true: visit the points worth most for their time, not all in order"
    )
    poses: str | None = Field(
        None, description="CSV file with the poses to visit (point,orientation,x,y,z,a,b,c)"
    )
    provisional: bool = Field(
        False, description="true: lend the controller a better geometry after the first point"
    )

    @model_validator(mode="after")
    def _points_are_chosen_or_listed(self) -> Self:
        if self.choose_points and self.poses is not None:
            raise broken_rule("a list of poses leaves no points to choose", "Remove one of the two")
        return self


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
    drift_mm: Positive = Field(0.1, description="of a point's reference, from its zeroing to its end")
    approval: Literal["ask", "automatic"] = Field(
        "ask", description="automatic: apply within the limits above without asking"
    )


class StationSettings(Section):
    """How the gauges get to each point."""

    alignment_deg: NotNegative = Field(
        0.3, description="how far the gauges' axes may be turned against the base's, deg, 1 sigma"
    )
    placement: Literal["by-hand", "fixed"] = Field(
        "by-hand", description="fixed: gauges are in place at every point without a person"
    )


class TaskSettings(Section):
    """What the robot is for: poses at which its predicted accuracy is stated."""

    poses: tuple[SixNumbers, ...] = Field((), description="x y z a b c, mm and deg")


class CellSettings(Section):
    """A whole cell file."""

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
            raise broken_rule("two gauges have the same name", "Give each its own")
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
            raise broken_rule("two thermometers have the same name", "Give each its own")
        return thermometers

    @model_validator(mode="after")
    def _real_devices_can_be_reached(self) -> Self:
        """Each is refused at its own place, so that a reader gets its line."""
        if self.simulation is not None:
            return self
        ways: list[tuple[tuple[str | int, ...], str, object]] = [
            *((("gauges", n), "the gauge has no port", gauge.port) for n, gauge in enumerate(self.gauges)),
            (("encoders",), "the encoders have no bus", self.encoders.bus),
            (("controller",), "the controller has no port", self.controller.port),
        ]
        refusals = [_unreachable(place, problem) for place, problem, way in ways if way is None]
        if refusals:
            raise ValidationError.from_exception_data(self.name, refusals)
        return self


def _unreachable(place: tuple[str | int, ...], problem: str) -> InitErrorDetails:
    rule = broken_rule(f"{problem}; only a cell with a [simulation] can do without", "Add it")
    return InitErrorDetails(type=rule, loc=place, input=None)
