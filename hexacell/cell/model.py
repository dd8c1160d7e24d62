"""The cell file as a whole, the rules that span its sections, and the keys that the mechanism decides."""

from collections.abc import Iterator
from datetime import date
from typing import Literal, Self, TypeVar

from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from hexacell.cell import measuring, operation
from hexacell.cell.devices import EncoderSettings, GaugeSettings, ThermometerSettings
from hexacell.cell.fields import CertificateSettings, Name, Section, broken_rule, key
from hexacell.cell.limits import (
    MOST_EXCLUSIONS,
    ExclusionSettings,
    LimitSettings,
    MotionSettings,
    SpeedSettings,
)
from hexacell.cell.recovery import RecoverySettings
from hexacell.cell.robot import ControllerOptions, ControllerSettings, RobotSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.cell.uncertainty import CommonUncertaintySettings, LengthCheckSettings, ModelSettings
from hexacell.kinematics.commanded_motion import RefusedCommands
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import JointUnit
from hexacell.storage.toml_document import KeyPath

MOST_THERMOMETERS = 100

FEWEST_POINTS = 2
"""Fewest points to measure: one alone does not identify the geometry."""

Named = TypeVar(
    "Named", bound="tuple[GaugeSettings | ThermometerSettings | operation.NotificationSettings, ...]"
)

Refusals = Iterator[tuple[KeyPath, PydanticCustomError]]


class ToleranceSettings(Section):
    """Largest deviations of the built robot from its drawing; has a key a kind, and ``ball_mm``."""


class CellSettings(Section):
    """A whole cell file."""

    version: Literal[1] = key(1, "version of the cell file's format")
    name: Name = key(..., "name of the cell, on screens and in reports")
    robot: RobotSettings
    controller: ControllerSettings
    gauges: tuple[GaugeSettings, GaugeSettings, GaugeSettings]
    encoders: EncoderSettings
    thermometers: tuple[ThermometerSettings, ...] = Field((), max_length=MOST_THERMOMETERS)
    stations: measuring.StationSettings = measuring.StationSettings()
    tolerances: ToleranceSettings = ToleranceSettings()
    noise: measuring.NoiseSettings = measuring.NoiseSettings()
    uncertainty: CommonUncertaintySettings = CommonUncertaintySettings()
    model: ModelSettings = ModelSettings()
    limits: LimitSettings = LimitSettings()
    exclusions: tuple[ExclusionSettings, ...] = Field((), max_length=MOST_EXCLUSIONS)
    motion: MotionSettings = MotionSettings()
    speed: SpeedSettings = SpeedSettings()
    timing: measuring.TimingSettings = measuring.TimingSettings()
    guards: measuring.GuardSettings = measuring.GuardSettings()
    identification: measuring.IdentificationSettings
    verification: measuring.VerificationSettings
    acceptance: measuring.AcceptanceSettings = measuring.AcceptanceSettings()
    check: measuring.CheckSettings = measuring.CheckSettings()
    quick: measuring.QuickSettings = measuring.QuickSettings()
    length_check: LengthCheckSettings | None = None
    recovery: RecoverySettings = RecoverySettings()
    unattended: operation.UnattendedSettings = operation.UnattendedSettings()
    archive: operation.ArchiveSettings = operation.ArchiveSettings()
    notifications: tuple[operation.NotificationSettings, ...] = Field(
        (), max_length=operation.MOST_NOTIFICATIONS
    )
    opcua: operation.OpcUaSettings | None = None
    screen: operation.ScreenSettings = operation.ScreenSettings()
    task: measuring.TaskSettings = measuring.TaskSettings()
    report: operation.ReportSettings = operation.ReportSettings()
    simulation: SimulationSettings | None = None

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that the file names; raises ``UsageError`` if it is not installed."""
        return self.robot.built()

    @property
    def drawing(self) -> Geometry:
        """The geometry by the drawing, in the drawing's frames."""
        return Geometry.of(self.mechanism.parameters, self.robot.nominal.model_dump())

    @property
    def excluded_points(self) -> frozenset[int]:
        """Numbers of the points, from 1, that the cell file excludes from measuring."""
        return frozenset(one.point for one in self.exclusions if one.point is not None)

    @property
    def excluded_commands(self) -> RefusedCommands:
        """The commands that the cell file excludes."""
        return RefusedCommands(tuple(one.refused for one in self.exclusions if one.refused is not None))

    @property
    def reference_agreement(self) -> tuple[float, float]:
        """What gauges, mm, and encoders, in their unit, may show at a reference beside what they did."""
        agreement_mm = self.recovery.agreement_mm
        is_rotary = self.mechanism.words.joint_unit is JointUnit.DEG
        return agreement_mm, self.timing.spread_encoder if is_rotary else agreement_mm

    @property
    def certificates(self) -> dict[str, CertificateSettings]:
        """The certificates of all instruments that have one, by the instrument's name."""
        fixture = self.length_check
        named = {
            **{f"gauge {gauge.name}": gauge.certificate for gauge in self.gauges},
            "encoders": self.encoders.certificate,
            "fixture of the length check": None if fixture is None else fixture.certificate,
        }
        return {name: certificate for name, certificate in named.items() if certificate is not None}

    def expired_on(self, day: date) -> tuple[str, ...]:
        """The instruments whose certificate holds no longer on a day."""
        return tuple(name for name, stated in self.certificates.items() if stated.has_expired(day))

    @field_validator("gauges")
    @classmethod
    def _gauges_make_a_triad(cls, gauges: tuple[GaugeSettings, ...]) -> tuple[GaugeSettings, ...]:
        if sorted(gauge.axis for gauge in gauges) != ["x", "y", "z"]:
            raise broken_rule("the three gauges must measure x, y and z, one each", "Correct their axis")
        inputs = [(gauge.port, gauge.place_on_line) for gauge in gauges if gauge.port is not None]
        if len(set(inputs)) != len(inputs):
            raise broken_rule("two gauges have the same port and channel", "Correct one of them")
        return gauges

    @field_validator("gauges", "thermometers", "notifications")
    @classmethod
    def _names_differ(cls, named: Named, info: ValidationInfo) -> Named:
        if len({one.name for one in named}) != len(named):
            raise broken_rule(f"two {info.field_name} have the same name", "Give each another name")
        return named

    @field_validator("thermometers")
    @classmethod
    def _thermometers_differ(
        cls, thermometers: tuple[ThermometerSettings, ...]
    ) -> tuple[ThermometerSettings, ...]:
        legs = [leg for thermometer in thermometers for leg in thermometer.legs]
        if len(set(legs)) != len(legs):
            raise broken_rule("two thermometers are on the same leg", "Name each leg once")
        return thermometers

    @model_validator(mode="after")
    def _sections_fit_together(self) -> Self:
        """Each refusal is at its own place, which gives it its line."""
        rules = (self._coordinates, self._plungers, self._excluded, self._length_check, self._connections)
        found = [InitErrorDetails(type=error, loc=at, input=None) for rule in rules for at, error in rule()]
        if found:
            raise ValidationError.from_exception_data(self.name, found)
        return self

    def _coordinates(self) -> Refusals:
        """The controller takes those of the mechanism."""
        stated, own = self.controller.coordinates, self.mechanism.coordinates
        if stated != own:
            problem = f"{stated} are not the coordinates of {self.robot.mechanism}, which are {own}"
            yield ("controller", "coordinates"), broken_rule(problem, f'Write coordinates = "{own}"')

    def _plungers(self) -> Refusals:
        plate, mounting = self.limits.gauge_travel_mm, self.stations.mounting_mm
        for n, gauge in enumerate(self.gauges):
            if (room := min(plate, gauge.travel_mm / 2)) <= mounting:
                yield (
                    ("gauges", n, "travel_mm"),
                    broken_rule(
                        f"mounting_mm = {mounting:g} leaves the plunger no room to move: it has "
                        f"{room:g} mm on either side of the middle",
                        "Lower mounting_mm in [stations], or correct travel_mm",
                    ),
                )

    def _excluded(self) -> Refusals:
        """Points exist, enough of them are left, and no reference of a measured point is excluded."""
        points, excluded = self.identification.points, self.excluded_points
        references = [point for n, point in enumerate(points, start=1) if n not in excluded]
        levels = [(*at, 0.0, 0.0, 0.0) for at in (*references, *self.verification.points)]
        for n, one in enumerate(self.exclusions):
            if one.point is not None and one.point > len(points):
                problem, action = f"there is no point {one.point}", f"Name one of the {len(points)} points"
            elif one.point is not None and len(references) < FEWEST_POINTS:
                left = f"{len(references)} of {len(points)} points would be left"
                problem, action = f"{left}, and the geometry needs {FEWEST_POINTS}", "Remove an exclusion"
            elif one.refused is not None and not all(map(RefusedCommands((one.refused,)).allows, levels)):
                problem = "this excludes the reference of a point, from which its gauges measure"
                action = "Lower within_deg, or exclude the whole point: point = ..."
            else:
                continue
            yield ("exclusions", n), broken_rule(problem, action)
            return

    def _length_check(self) -> Refusals:
        named = self.length_check and self.length_check.thermometer
        if named and named not in {thermometer.name for thermometer in self.thermometers}:
            problem = f"the cell has no thermometer '{named}'"
            action = "Write the name of one of [[thermometers]], or remove it and write temperature_c"
            yield ("length_check", "thermometer"), broken_rule(problem, action)
        elif self.length_check is not None and self.mechanism.words.joint_unit is JointUnit.DEG:
            problem = (
                "a length check finds what is wrong with the scale of encoders of lengths; those of this "
                "mechanism are of angles"
            )
            yield ("length_check",), broken_rule(problem, "Remove [length_check]")

    def _connections(self) -> Refusals:
        """Real devices have an address; that of a controller may be among options of its own."""
        controller, options = self.controller, self.controller.options
        connections: list[tuple[KeyPath, str, object]] = [
            *((("gauges", n), "the gauge has no port", gauge.port) for n, gauge in enumerate(self.gauges)),
            (("encoders",), "the encoders have no bus", self.encoders.address),
            (
                ("controller",),
                "the controller has no port",
                controller.port if type(options) is ControllerOptions else options,
            ),
        ]
        for place, problem, given in connections:
            if given is None and self.simulation is None:
                text = f"{problem}; only a cell with a [simulation] may leave it away"
                yield place, broken_rule(text, "Add it")
