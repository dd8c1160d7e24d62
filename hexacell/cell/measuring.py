"""Sections of the cell file on measuring: where and how, within which limits, and when it is accepted."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from hexacell.cell.fields import (
    NotNegative,
    PointInRange,
    Positive,
    Section,
    Seed,
    SixInRange,
    Text,
    broken_rule,
)

MOST_POINTS, MOST_POSES, MOST_RECORDS = 100, 1000, 10_000
MOST_REVISITS = 100
"""More would take longer than any machine stays as it is."""


class StationSettings(Section):
    """How the gauges are placed at each point."""

    alignment_deg: NotNegative = Field(
        0.3, description="angle between the gauges' axes and the base axes, deg, 1 sigma"
    )
    placement: Literal["by-hand", "fixed"] = Field(
        "by-hand",
        description="how the gauges come to a point: by-hand, or fixed where they need no placing",
    )
    trial_mm: NotNegative = Field(
        1.0,
        description="size of the small moves by which gauges are tried once they were placed or "
        "connected, mm; 0: none",
    )
    mounting_mm: NotNegative = Field(
        1.0, description="how far from the middle of its travel a plunger may stand when it is zeroed, mm"
    )


class IdentificationSettings(Section):
    """Where the geometry is measured."""

    points: tuple[PointInRange, ...] = Field(
        min_length=2, max_length=MOST_POINTS, description="ball positions, mm, in the order of their visits"
    )
    orientations: int = Field(
        11,
        ge=2,
        le=MOST_POSES,
        description="records at each point, its reference included; "
        "those of a point out of reach are taken at the others",
    )
    seed: Seed = Field(1, description="random seed of the candidate orientations")
    criterion: Literal["task", "parameters", "information"] = Field(
        "information",
        description="what a pose reduces: the error at the task poses or of all parameters; or bits gained",
    )
    target_mm: Positive | None = Field(
        None, description="predicted error at every task pose, mm, 1 sigma, below which measuring is done"
    )
    least_gain_mm: NotNegative = Field(
        0.0, description="gain in that error below which no further record is worth its time, mm"
    )
    budget_records: int | None = Field(
        None, ge=2, le=MOST_RECORDS, description="most records, references included"
    )
    budget_minutes: Positive | None = Field(None, description="longest estimated duration, minutes")
    minutes_per_station: NotNegative = Field(
        5.0, description="time to place the gauges at a point by hand, minutes"
    )
    seconds_per_record: Positive | None = Field(
        None, description="time to move and settle, s; by default from [timing]"
    )
    choose_points: bool = Field(
        False, description="whether the points with the largest gain per time are visited, not all in order"
    )
    poses: Text | None = Field(
        None, description="CSV file with the poses to visit (point,orientation,x,y,z,a,b,c)"
    )
    provisional: bool = Field(
        False, description="whether a better geometry is written to the controller after the first point"
    )
    identify: tuple[Literal["all", "zeros"], ...] = Field(
        ("all",),
        description='["zeros"]: the encoders\' zeros alone; all else stays as the controller has it',
    )

    @field_validator("identify", mode="before")
    @classmethod
    def _one_word_is_a_list(cls, given: object) -> object:
        if isinstance(given, str):
            return (given,)
        return tuple(given) if isinstance(given, list) else given

    @property
    def only_zeros(self) -> bool:
        """Whether the encoders' zeros alone are identified."""
        return self.identify == ("zeros",)

    @model_validator(mode="after")
    def _one_choice(self) -> Self:
        if len(self.identify) != 1:
            raise broken_rule("identify is one of all and zeros", 'Write ["zeros"], or remove it')
        return self

    @model_validator(mode="after")
    def _zeros_alone_are_not_written_provisionally(self) -> Self:
        if self.only_zeros and self.provisional:
            raise broken_rule(
                "a provisional geometry has all parameters, and zeros alone are to be identified",
                "Remove provisional, or identify",
            )
        return self

    @model_validator(mode="after")
    def _points_are_chosen_or_listed(self) -> Self:
        if self.choose_points and self.poses is not None:
            raise broken_rule("a list of poses leaves no points to choose", "Remove one of the two")
        return self


class VerificationSettings(Section):
    """Where the result is validated: poses that are not in the fit."""

    points: tuple[PointInRange, ...] = Field(
        min_length=1, max_length=MOST_POINTS, description="ball positions of the held-out poses, mm"
    )
    orientations: int = Field(
        6, ge=2, le=MOST_POSES, description="poses at each point, its reference included"
    )
    seed: Seed = Field(2, description="random seed of the held-out orientations")


class AcceptanceSettings(Section):
    """When a result is good, and who approves writing it to the controller."""

    position_mm: Positive = Field(0.15, description="largest position error at the task poses, mm")
    orientation_deg: Positive = Field(0.05, description="largest orientation error at the task poses, deg")
    guard_band_factor: float = Field(
        1.5,
        ge=1.0,
        le=3.0,
        description="factor of U by which a pass keeps away from the limits; 1.5 is three sigma",
    )
    largest_change_mm: Positive = Field(
        15.0, description="largest change of a parameter that no person need approve, mm"
    )
    drift_mm: Positive = Field(
        0.1, description="largest drift of a point's reference, from its zeroing to its end, mm"
    )
    valid_days: Positive | None = Field(None, description="days after which the next calibration is due")
    approval: Literal["ask", "automatic"] = Field(
        "ask", description="who approves a write: ask, a person; automatic, nobody within the limits above"
    )


FEWEST_STANDSTILL_READINGS = 8
"""Fewer readings at standstill show no noise."""


class CheckSettings(Section):
    """A check of the robot as it is now, from the last accepted result on."""

    drift_per_parameter_mm: Positive = Field(
        0.02, description="drift since the last result that is expected of each parameter, mm, 1 sigma"
    )
    budget_records: int = Field(40, ge=4, le=MOST_RECORDS, description="most records, references included")


class QuickSettings(Section):
    """The quick level: a check carried on until the robot is known as well as after its calibration."""

    budget_records: int = Field(
        24,
        ge=4,
        le=MOST_RECORDS,
        description="most records, references included; held-out poses come on top",
    )


class TaskSettings(Section):
    """The robot's task: poses for which its accuracy is predicted, and the frames that can be taught."""

    poses: tuple[SixInRange, ...] = Field(
        (), max_length=MOST_POSES, description="poses of the task: x, y, z, mm, and a, b, c, deg"
    )
    work_frame: Literal["", "x", "y", "z", "xy", "xz", "yz", "xyz"] = Field(
        "xyz",
        description="base axes about which the controller can turn a work frame; it can always shift it. "
        "Errors that a work frame or a tool frame removes do not count",
    )


class TimingSettings(Section):
    """When a reading counts as settled."""

    window_s: Positive = Field(0.6, description="span of readings that must agree, s")
    interval_s: Positive = Field(0.1, description="time from the begin of a reading to the next, s")
    readings: int = Field(5, ge=2, le=1000, description="smallest number of readings in the window")
    spread_gauge_mm: Positive = Field(0.06, description="largest range of one gauge in the window, mm")
    spread_encoder: Positive = Field(
        0.06, alias="spread_encoder_mm", description="largest range of one encoder in the window"
    )
    give_up_s: Positive = Field(20.0, description="longest wait for settled readings, s")
    move_s: Positive | None = Field(
        None,
        description="duration of an ordinary move, s, for time estimates only; by default from [speed]",
    )
    clock_factor: Positive = Field(
        1.0, description="cell seconds per second of real time, in simulated cells only"
    )


class NoiseSettings(Section):
    """Standard deviations of the numbers of one record, and how a run measures them at its start."""

    encoder: Positive = Field(0.01, alias="encoder_mm", description="noise of an encoder, 1 sigma")
    gauge_scale: NotNegative = Field(0.001, description="relative error of each gauge's scale, 1 sigma")
    gauge_mm: Positive = Field(0.01, description="noise of a gauge's reading, mm, 1 sigma")
    encoders: tuple[Positive, Positive, Positive, Positive, Positive, Positive] | None = Field(
        None,
        alias="encoders_mm",
        description="noise of each encoder, 1 sigma, where they differ; takes the place of that of all",
    )
    gauges_mm: tuple[Positive, Positive, Positive] | None = Field(
        None,
        description="noise of the gauges x, y and z, mm, 1 sigma, where they differ; takes the place of "
        "gauge_mm",
    )
    figures: Literal["stated", "measured"] = Field(
        "stated",
        description="what these figures are: stated, they hold unless a run measures significantly more; "
        "measured, what a run measures replaces them where it is less, too",
    )
    standstill_readings: int = Field(
        40,
        ge=0,
        le=1000,
        description="readings at the first point without moving, for the noise of readings; 0: none",
    )
    revisits: int = Field(
        6,
        ge=0,
        le=MOST_REVISITS,
        description="visits to the first reference from different directions; while little is known of the "
        "robot, it leaves for poses at which the gauges are read, to choose the others by; 0: none",
    )
    averaged_windows: int = Field(
        1, ge=1, le=16, description="most settled windows that a record may be the mean of, where that pays"
    )

    def gauge_at(self, index: int) -> float:
        """Noise of the readings of gauge x, y or z, index 0 to 2, mm."""
        return self.gauge_mm if self.gauges_mm is None else self.gauges_mm[index]

    @model_validator(mode="after")
    def _series_are_long_enough(self) -> Self:
        if 0 < self.standstill_readings < FEWEST_STANDSTILL_READINGS:
            raise broken_rule(
                f"{self.standstill_readings} standstill_readings are no series",
                f"Ask for {FEWEST_STANDSTILL_READINGS} or more, or for 0",
            )
        return self


class GuardSettings(Section):
    """When motion is stopped; more limits are in [limits] and [acceptance]."""

    stop_file: Text | None = Field(
        None, description="file whose existence forbids motion, relative to the cell file"
    )
    stop_port: Text | None = Field(
        None, description="serial port of a stop contact, closed while motion is allowed"
    )
    stop_contact: Literal["dsr", "cts"] = Field(
        "dsr", description="lines of stop_port that the contact joins: dsr, DTR and DSR; cts, RTS and CTS"
    )
    stale_s: Positive = Field(
        0.12, description="longest silence of a device while the robot moves, s of real time"
    )
    plate_margin_mm: NotNegative = Field(
        0.5, description="margin beyond limits.gauge_travel_mm during a move, when the ball swings, mm"
    )
    following: Positive = Field(
        1.0, alias="following_mm", description="largest difference of a joint from its commanded position"
    )
    free_disk_mb: float = Field(
        50.0, ge=0, le=1e12, allow_inf_nan=False, description="least free space for the run folder, MB"
    )
