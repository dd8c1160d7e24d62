"""Sections of the cell file on measuring: where and how, within which limits, and when it is accepted."""

from typing import Literal, Self

from pydantic import field_validator, model_validator

from hexacell.cell.fields import (
    NotNegative,
    PointInRange,
    Positive,
    Section,
    Seed,
    SerialPortName,
    Six,
    SixInRange,
    Text,
    broken_rule,
    key,
)

MOST_POINTS, MOST_POSES, MOST_RECORDS = 100, 1000, 10_000
MOST_COMPARED = 3
"""So many held-out poses of a point show how wrong the robot was; the model is judged by later ones."""
MOST_REVISITS = 100
"""More would take longer than any machine stays as it is."""


class StationSettings(Section):
    """How the gauges are placed at each point."""

    alignment_deg: NotNegative = key(0.3, "angle between the gauges' axes and the base axes, deg, 1 sigma")
    placement: Literal["by-hand", "fixed"] = key(
        "by-hand", "how the gauges come to a point: by-hand, or fixed where they need no placing"
    )
    trial_mm: NotNegative = key(
        1.0, "length of the small moves by which gauges are tried once placed or connected, mm; 0: none"
    )
    mounting_mm: NotNegative = key(
        1.0, "how far from the middle of its travel a plunger may stand when it is zeroed, mm"
    )


class IdentificationSettings(Section):
    """Where the geometry is measured."""

    points: tuple[PointInRange, ...] = key(
        ..., "ball positions, mm, in the order of their visits", min_length=2, max_length=MOST_POINTS
    )
    orientations: int = key(
        11,
        "records at each point, its reference included; those of a point out of reach are taken at the "
        "others",
        ge=2,
        le=MOST_POSES,
    )
    seed: Seed = key(1, "random seed of the candidate orientations")
    criterion: Literal["task", "parameters", "information"] = key(
        "information",
        "what a pose reduces: the error at the task poses or of all parameters; or bits gained",
    )
    target_mm: Positive | None = key(
        None, "U of the largest error at the task poses, mm, from which on measuring is done"
    )
    budget_records: int | None = key(None, "most records, references included", ge=2, le=MOST_RECORDS)
    budget_minutes: Positive | None = key(
        None, "duration of the whole run, minutes; it decides how many records the points get"
    )
    minutes_per_station: NotNegative = key(5.0, "time to place the gauges at a point by hand, minutes")
    choose_points: bool = key(
        False, "whether the points with the largest gain per time are visited, not all in order"
    )
    poses: Text | None = key(None, "CSV file with the poses to visit (point,orientation,x,y,z,a,b,c)")
    provisional: bool = key(
        False, "whether a better geometry is written to the controller after the first point"
    )
    identify: Literal["all", "zeros"] = key(
        "all", '"zeros": the encoders\' zeros alone; all else stays as the controller has it'
    )

    @field_validator("identify", mode="before")
    @classmethod
    def _a_list_has_one_word(cls, given: object) -> object:
        return given[0] if isinstance(given, list) and len(given) == 1 else given

    @property
    def only_zeros(self) -> bool:
        """Whether the encoders' zeros alone are identified."""
        return self.identify == "zeros"

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

    points: tuple[PointInRange, ...] = key(
        ..., "ball positions of the held-out poses, mm", min_length=1, max_length=MOST_POINTS
    )
    orientations: int = key(6, "poses at each point, its reference included", ge=2, le=MOST_POSES)
    seed: Seed = key(2, "random seed of the held-out orientations")

    @property
    def compared(self) -> int:
        """Poses at each point, its reference included, that are measured before the write-back as well."""
        return min(MOST_COMPARED, self.orientations)

    @property
    def afterwards(self) -> int:
        """Poses at each point after it: those, and others as wide as the limits."""
        return self.compared + self.orientations - 1


class ErrorLimits(Section):
    """What the errors at the task poses must keep."""

    position_mm: Positive = key(0.15, "largest position error at the task poses, mm")
    orientation_deg: Positive = key(0.05, "largest orientation error at the task poses, deg")
    guard_band_factor: float = key(
        1.5, "factor of U by which a pass keeps away from the limits; 1.5 is three sigma", ge=1.0, le=3.0
    )


class AcceptanceSettings(ErrorLimits):
    """When a result is good, and who approves writing it to the controller."""

    largest_change_mm: Positive = key(15.0, "largest change of a parameter that no person need approve, mm")
    drift_mm: Positive = key(0.1, "largest drift of a point's reference, from its zeroing to its end, mm")
    valid_days: Positive | None = key(None, "days after which the next calibration is due")
    approval: Literal["ask", "automatic"] = key(
        "ask", "who approves a write: ask, a person; automatic, nobody within the limits above"
    )

    @property
    def of_errors(self) -> ErrorLimits:
        """The limits of errors alone."""
        return ErrorLimits(**self.model_dump(include={*ErrorLimits.model_fields}))


FEWEST_STANDSTILL_READINGS = 8
"""Fewer readings at standstill show no noise."""


class CheckSettings(Section):
    """A check of the robot as it is now, from the last accepted result on."""

    drift_per_parameter_mm: Positive = key(
        0.02, "drift since the last result that is expected of each parameter, mm, 1 sigma"
    )
    budget_records: int = key(40, "most records, references included", ge=4, le=MOST_RECORDS)


class QuickSettings(Section):
    """The quick level: a check carried on until the robot is known as well as after its calibration."""

    budget_records: int = key(
        24, "most records, references included; held-out poses come on top", ge=4, le=MOST_RECORDS
    )


class TaskSettings(Section):
    """The robot's task: poses for which its accuracy is predicted, and the frames that can be taught."""

    poses: tuple[SixInRange, ...] = key(
        (), "poses of the task: x, y, z, mm, and a, b, c, deg", max_length=MOST_POSES
    )
    work_frame: Literal["", "x", "y", "z", "xy", "xz", "yz", "xyz"] = key(
        "xyz",
        "base axes about which the controller can turn a work frame; it can always shift it. Errors that "
        "a work frame or a tool frame removes do not count",
    )


class TimingSettings(Section):
    """When a reading counts as settled."""

    window_s: Positive = key(0.6, "span of readings that must agree, s")
    interval_s: Positive = key(0.1, "time from the begin of a reading to the next, s")
    readings: int = key(5, "smallest number of readings in the window", ge=2, le=1000)
    spread_gauge_mm: Positive = key(0.06, "largest range of one gauge in the window, mm")
    spread_encoder: Positive = key(
        0.06, "largest range of one encoder in the window", alias="spread_encoder_mm"
    )
    give_up_s: Positive = key(20.0, "longest wait for settled readings, s")
    clock_factor: Positive = key(1.0, "cell seconds per second of real time, in simulated cells only")


class NoiseSettings(Section):
    """Standard deviations of the numbers of one record, and how a run measures them at its start."""

    encoder: Positive = key(0.01, "noise of an encoder, 1 sigma", alias="encoder_mm")
    gauge_scale: NotNegative = key(0.001, "relative error of each gauge's scale, 1 sigma")
    gauge_mm: Positive = key(0.01, "noise of a gauge's reading, mm, 1 sigma")
    encoders: Six[Positive] | None = key(
        None,
        "noise of each encoder, 1 sigma, where they differ; takes the place of that of all",
        alias="encoders_mm",
    )
    gauges_mm: tuple[Positive, Positive, Positive] | None = key(
        None, "noise of the gauges x, y and z, mm, 1 sigma, where they differ; takes the place of gauge_mm"
    )
    stops: NotNegative = key(
        0.0,
        "where a joint stops beside its command, as its encoder shows it, 1 sigma; what a run measures "
        "takes its place where that is more",
        alias="stops_mm",
    )
    figures: Literal["stated", "measured"] = key(
        "stated",
        "what these figures are: stated, they hold unless a run measures significantly more; measured, "
        "what a run measures replaces them where it is less, too",
    )
    standstill_readings: int = key(
        40, "readings at the first point without moving, for the noise of readings; 0: none", ge=0, le=1000
    )
    revisits: int = key(
        6,
        "visits to the first reference from different directions; while little is known of the robot, it "
        "leaves for poses at which the gauges are read, to choose the others by; 0: none",
        ge=0,
        le=MOST_REVISITS,
    )
    averaged_windows: int | None = key(
        None,
        "most settled windows that a record may be the mean of, where that pays; by default up to 4, where "
        "acceptance.position_mm or identification.target_mm needs it",
        ge=1,
        le=16,
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

    stop_file: Text | None = key(None, "file whose existence forbids motion, relative to the cell file")
    stop_port: SerialPortName | None = key(
        None, "serial port of a stop contact, closed while motion is allowed"
    )
    stop_contact: Literal["dsr", "cts"] = key(
        "dsr", "lines of stop_port that the contact joins: dsr, DTR and DSR; cts, RTS and CTS"
    )
    stale_s: Positive = key(0.12, "longest silence of a device while the robot moves, s of real time")
    plate_margin_mm: NotNegative = key(
        0.5, "margin beyond limits.gauge_travel_mm during a move, when the ball swings, mm"
    )
    following: Positive = key(
        1.0, "largest difference of a joint from its commanded position", alias="following_mm"
    )
    limits: Literal["measured", "fixed"] = key(
        "measured",
        "whether following, acceptance.drift_mm and recovery.agreement_mm widen for a machine that was "
        "measured to repeat less well; fixed: they never do",
    )
    free_disk_mb: float = key(
        50.0, "least free space for the run folder, MB", ge=0, le=1e12, allow_inf_nan=False
    )
