"""The cell file as a whole, the rules that span its sections, and the keys that the mechanism decides."""

from __future__ import annotations

from datetime import date
from functools import cache
from typing import Any, Literal, Self, TypeVar

from pydantic import Field, ValidationError, create_model, field_validator, model_validator
from pydantic_core import InitErrorDetails

from hexacell.cell.archive import ArchiveSettings
from hexacell.cell.certificates import CertificateSettings, ReportSettings
from hexacell.cell.controller import ControllerSettings, RotaryControllerSettings
from hexacell.cell.devices import (
    EncoderSettings,
    GaugeSettings,
    LinearEncoderSettings,
    RotaryEncoderSettings,
    ThermometerSettings,
)
from hexacell.cell.fields import (
    GeometrySettings,
    InRange,
    Name,
    NotNegative,
    Positive,
    Section,
    broken_rule,
)
from hexacell.cell.joint_units import in_joint_unit
from hexacell.cell.length_check import LengthCheckSettings
from hexacell.cell.limits import LimitSettings
from hexacell.cell.measuring import (
    AcceptanceSettings,
    CheckSettings,
    GuardSettings,
    IdentificationSettings,
    NoiseSettings,
    QuickSettings,
    StationSettings,
    TaskSettings,
    TimingSettings,
    VerificationSettings,
)
from hexacell.cell.notifications import MOST_NOTIFICATIONS, NotificationSettings
from hexacell.cell.opcua import OpcUaSettings
from hexacell.cell.recovery import RecoverySettings
from hexacell.cell.robot import RobotSettings, mechanism_of
from hexacell.cell.simulation import SimulatedEncoders, SimulatedMotion, SimulationSettings
from hexacell.cell.speed import SpeedSettings
from hexacell.cell.unattended import UnattendedSettings
from hexacell.cell.uncertainty import (
    CommonUncertaintySettings,
    LinearUncertaintySettings,
    RotaryUncertaintySettings,
    UncertaintySettings,
)
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import LEGS, JointUnit, ParameterKind, ParameterSet

MOST_THERMOMETERS = 100

SectionType = TypeVar("SectionType", bound=Section)


class ToleranceSettings(Section):
    """Largest deviations of the built robot from its drawing; has a key a kind, and ``ball_mm``."""


class CellSettings(Section):
    """A whole cell file."""

    version: Literal[1] = Field(1, description="of this file's format")
    name: Name = Field(description="of the cell, on screens and in reports")
    robot: RobotSettings
    controller: ControllerSettings
    gauges: tuple[GaugeSettings, GaugeSettings, GaugeSettings]
    encoders: EncoderSettings
    thermometers: tuple[ThermometerSettings, ...] = Field((), max_length=MOST_THERMOMETERS)
    stations: StationSettings = StationSettings()
    tolerances: ToleranceSettings = ToleranceSettings()
    noise: NoiseSettings = NoiseSettings()
    uncertainty: CommonUncertaintySettings = CommonUncertaintySettings()
    limits: LimitSettings = LimitSettings()
    speed: SpeedSettings = SpeedSettings()
    timing: TimingSettings = TimingSettings()
    guards: GuardSettings = GuardSettings()
    identification: IdentificationSettings
    verification: VerificationSettings
    acceptance: AcceptanceSettings = AcceptanceSettings()
    check: CheckSettings = CheckSettings()
    quick: QuickSettings = QuickSettings()
    length_check: LengthCheckSettings | None = None
    recovery: RecoverySettings = RecoverySettings()
    unattended: UnattendedSettings = UnattendedSettings()
    archive: ArchiveSettings = ArchiveSettings()
    notifications: tuple[NotificationSettings, ...] = Field((), max_length=MOST_NOTIFICATIONS)
    opcua: OpcUaSettings | None = None
    task: TaskSettings = TaskSettings()
    report: ReportSettings = ReportSettings()
    simulation: SimulationSettings | None = None

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that the file names; raises ``UsageError`` if it is not installed."""
        return self.robot.built()

    @property
    def reference_agreement(self) -> tuple[float, float]:
        """What gauges, mm, and encoders, in their unit, may show at a reference beside what they did."""
        agreement_mm = self.recovery.agreement_mm
        is_rotary = self.mechanism.words.joint_unit is JointUnit.DEG
        return agreement_mm, self.timing.spread_encoder if is_rotary else agreement_mm

    @property
    def certificates(self) -> dict[str, CertificateSettings]:
        """Those of all instruments that have one, by the instrument's name."""
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
        if len({gauge.name for gauge in gauges}) != 3:
            raise broken_rule("two gauges have the same name", "Give each another name")
        inputs = [(gauge.port, gauge.place_on_line) for gauge in gauges if gauge.port is not None]
        if len(set(inputs)) != len(inputs):
            raise broken_rule("two gauges have the same port and channel", "Correct one of them")
        return gauges

    @model_validator(mode="after")
    def _plungers_may_move(self) -> Self:
        """Each gauge is refused at its own place, which gives the error its line."""
        plate, mounting = self.limits.gauge_travel_mm, self.stations.mounting_mm
        refusals = [
            InitErrorDetails(
                type=broken_rule(
                    f"mounting_mm = {mounting:g} leaves the plunger no room to move: it has "
                    f"{min(plate, gauge.travel_mm / 2):g} mm on either side of the middle",
                    "Lower mounting_mm in [stations], or correct travel_mm",
                ),
                loc=("gauges", n, "travel_mm"),
                input=gauge.travel_mm,
            )
            for n, gauge in enumerate(self.gauges)
            if min(plate, gauge.travel_mm / 2) <= mounting
        ]
        if refusals:
            raise ValidationError.from_exception_data(self.name, refusals)
        return self

    @field_validator("notifications")
    @classmethod
    def _notifications_differ(
        cls, notifications: tuple[NotificationSettings, ...]
    ) -> tuple[NotificationSettings, ...]:
        if len({one.name for one in notifications}) != len(notifications):
            raise broken_rule("two notifications have the same name", "Give each another name")
        return notifications

    @field_validator("thermometers")
    @classmethod
    def _thermometers_differ(
        cls, thermometers: tuple[ThermometerSettings, ...]
    ) -> tuple[ThermometerSettings, ...]:
        if len({thermometer.name for thermometer in thermometers}) != len(thermometers):
            raise broken_rule("two thermometers have the same name", "Give each another name")
        legs = [leg for thermometer in thermometers for leg in thermometer.legs]
        if len(set(legs)) != len(legs):
            raise broken_rule("two thermometers are on the same leg", "Name each leg once")
        return thermometers

    @model_validator(mode="after")
    def _the_thermometer_of_the_fixture_exists(self) -> Self:
        named = self.length_check and self.length_check.thermometer
        if named and named not in {thermometer.name for thermometer in self.thermometers}:
            refusal = broken_rule(
                f"the cell has no thermometer '{named}'",
                "Write the name of one of [[thermometers]], or remove it and write temperature_c",
            )
            place = ("length_check", "thermometer")
            detail = InitErrorDetails(type=refusal, loc=place, input=named)
            raise ValidationError.from_exception_data(self.name, [detail])
        return self

    @model_validator(mode="after")
    def _a_length_check_is_of_encoders_of_lengths(self) -> Self:
        if self.length_check is not None and self.mechanism.words.joint_unit is JointUnit.DEG:
            refusal = broken_rule(
                "a length check finds what is wrong with the scale of encoders of lengths; those of this "
                "mechanism are of angles",
                "Remove [length_check]",
            )
            detail = InitErrorDetails(type=refusal, loc=("length_check",), input=None)
            raise ValidationError.from_exception_data(self.name, [detail])
        return self

    @model_validator(mode="after")
    def _real_devices_can_be_reached(self) -> Self:
        """Each missing connection is refused at its own place, which gives the error its line."""
        if self.simulation is not None:
            return self
        connections: list[tuple[tuple[str | int, ...], str, object]] = [
            *((("gauges", n), "the gauge has no port", gauge.port) for n, gauge in enumerate(self.gauges)),
            (("encoders",), "the encoders have no bus", self.encoders.address),
            (("controller",), "the controller has no port", self.controller.port),
        ]
        refusals = [
            InitErrorDetails(
                type=broken_rule(f"{problem}; only a cell with a [simulation] needs none", "Add it"),
                loc=place,
                input=None,
            )
            for place, problem, given in connections
            if given is None
        ]
        if refusals:
            raise ValidationError.from_exception_data(self.name, refusals)
        return self


def cell_model(mechanism: str, *, encoder_scales: bool = False) -> type[CellSettings]:
    """The model of the cell files of one mechanism; raises ``UsageError`` if it is not installed.

    Each has one model only, however it is asked for: settings of two would never be equal.
    """
    return _cell_model(mechanism, encoder_scales)


@cache
def _cell_model(mechanism: str, encoder_scales: bool) -> type[CellSettings]:
    found = mechanism_of(mechanism, encoder_scales=encoder_scales)
    parameters = found.parameters
    geometry, tolerances = geometry_settings(parameters), tolerance_settings(parameters)
    has_defaults = not any(field.is_required() for field in tolerances.model_fields.values())
    robot = _derived(RobotSettings, nominal=(geometry, RobotSettings.model_fields["nominal"]))
    truth = SimulationSettings.model_fields["geometry"]
    simulated = _in_unit(found, encoders=SimulatedEncoders, motion=SimulatedMotion)
    simulation = _derived(SimulationSettings, geometry=(geometry, truth), **simulated)
    uncertainty = uncertainty_settings(found)
    is_rotary = found.words.joint_unit is JointUnit.DEG
    encoders = in_joint_unit(
        RotaryEncoderSettings if is_rotary else LinearEncoderSettings, found.words.joint_unit
    )
    return _derived(
        CellSettings,
        uncertainty=(uncertainty, uncertainty()),
        robot=(robot, ...),
        encoders=(encoders, ...),
        controller=(RotaryControllerSettings if is_rotary else ControllerSettings, ...),
        tolerances=(tolerances, tolerances() if has_defaults else ...),
        simulation=(simulation | None, None),
        **_in_unit(
            found,
            noise=NoiseSettings,
            limits=LimitSettings,
            speed=SpeedSettings,
            timing=TimingSettings,
            guards=GuardSettings,
        ),
    )


def uncertainty_settings(mechanism: Mechanism) -> type[CommonUncertaintySettings]:
    """The section of the effects that a mechanism has."""
    if mechanism.words.joint_unit is JointUnit.DEG:
        return RotaryUncertaintySettings
    return LinearUncertaintySettings if mechanism.words.guide is None else UncertaintySettings


def _in_unit(mechanism: Mechanism, **sections: type[Section]) -> dict[str, Any]:
    """Fields of sections with a default, in the unit of the mechanism's joint variables."""
    made = {name: in_joint_unit(one, mechanism.words.joint_unit) for name, one in sections.items()}
    return {name: (one, one()) for name, one in made.items()}


def geometry_settings(parameters: ParameterSet) -> type[GeometrySettings]:
    """The section for a geometry of these parameters."""
    fields: dict[str, Any] = {
        kind.symbol: (_array_type(kind), Field(_default(kind), description=kind.meaning))
        for kind in parameters.kinds
    }
    return _derived(GeometrySettings, **fields)


def tolerance_settings(parameters: ParameterSet) -> type[ToleranceSettings]:
    """The section for the tolerances of these parameters."""
    fields: dict[str, Any] = {
        kind.tolerance_key: (Positive, _tolerance_field(kind)) for kind in parameters.kinds
    }
    kinds = " and ".join(kind.symbol for kind in parameters.kinds if kind.has_ball_offset)
    description = f"mounting of the ball: an offset common to all {kinds}"
    fields["ball_mm"] = (NotNegative, Field(0.0, description=description))
    return _derived(ToleranceSettings, **fields)


def _tolerance_field(kind: ParameterKind) -> Any:  # noqa: ANN401 - what pydantic's Field returns
    default = ... if kind.default_tolerance is None else kind.default_tolerance
    return Field(default, description=kind.tolerance_meaning)


def _default(kind: ParameterKind) -> Any:  # noqa: ANN401 - what pydantic's Field takes
    return ... if kind.default is None else (kind.default,) * LEGS


def _array_type(kind: ParameterKind) -> Any:  # noqa: ANN401 - a type made here
    made: Any = Positive if kind.is_positive else InRange
    for length in reversed(kind.shape):
        made = tuple.__class_getitem__((made,) * length)
    return made


def _derived(base: type[SectionType], /, **fields: Any) -> type[SectionType]:  # noqa: ANN401
    """A section with the fields that the mechanism decides; each is a type and a default or description."""
    made: type[SectionType] = create_model(base.__name__, __base__=base, __doc__=base.__doc__, **fields)
    return made
