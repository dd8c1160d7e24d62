"""The section of a simulated cell: its true geometry, motion, noise and faults."""

from typing import Literal, Self

from pydantic import model_validator

from hexacell.cell.fields import (
    Direction,
    GeometrySettings,
    InRange,
    NotNegative,
    PointInRange,
    Positive,
    Section,
    Seed,
    SixAlike,
    SixInRange,
    Text,
    broken_rule,
    key,
)
from hexacell.cell.robot import STARTUP_WORDS, StartupWord

FaultKind = Literal[
    "emergency stop",
    "following error",
    "stop line",
    "unplugged",
    "silent",
    "at its end",
    "off its plate",
    "off its middle",
    "reversed",
    "in inches",
    "exchanged",
    "frozen",
    "on hold",
    "in peak mode",
    "zeroed",
    "low battery",
    "switched on again",
    "damaged",
    "cut short",
    "repeated",
    "unasked",
    "late",
    "echoing",
    "NUL bytes",
    "jumped",
    "alarm",
    "warning",
    "two steps",
    "SYNC counter",
    "forward kinematics",
    "old config",
    "ignored corrections",
]


class SimulatedGauges(Section):
    """How the simulated dial indicators behave."""

    noise_mm: NotNegative = key(0.01, "noise drawn at every stop of the robot, mm, 1 sigma")
    flicker_mm: NotNegative = key(0.001, "noise drawn at every reading, mm, 1 sigma")
    latency_s: NotNegative = key(0.02, "time between request and answer, s")
    restart_s: NotNegative = key(
        0.0, "how long they hear and send nothing after their port was opened, s of real time"
    )
    baudrate: int | None = key(
        None, "speed of the line, baud; by default the protocol's", ge=300, le=10_000_000
    )
    transport: Literal["pty", "socket"] = key("pty", "how the gauges' lines are simulated")
    misalignment_deg: NotNegative = key(0.0, "misalignment of the triad at each station, deg, 1 sigma")
    placing_mm: NotNegative = key(0.25, "distance from mid-travel at which gauges are placed, mm, 1 sigma")
    off_middle_mm: tuple[InRange, InRange, InRange] = key(
        (0.0, 0.0, 0.0), "constant distance of the ball from mid-travel along x, y, z beside that, mm"
    )
    drift_um: NotNegative = key(
        0.0, "random walk of their mounts along each axis in a minute of cell time, um, 1 sigma"
    )


class SimulatedEncoders(Section):
    """How the simulated CANopen encoders behave."""

    noise: NotNegative = key(0.01, "noise drawn at every stop of the robot, 1 sigma", alias="noise_mm")
    flicker: NotNegative = key(0.001, "noise drawn at every sample, 1 sigma", alias="flicker_mm")
    latency_s: NotNegative = key(0.001, "time between SYNC and the last answer, s")
    common_scale_um_m: InRange = key(0.0, "scale error that all encoders have alike, um/m", ge=-1e5, le=1e5)


class SimulatedMotion(Section):
    """How the simulated robot moves."""

    speed: Positive = key(
        100.0, "speed of the fastest joint, however short a move is to be", alias="speed_mm_s"
    )
    minimum_s: NotNegative = key(0.3, "shortest duration of a move, s")
    ringing_mm: NotNegative = key(0.2, "amplitude of the ball's oscillation on arrival, mm")
    ringing_s: Positive = key(0.15, "time constant of that oscillation's decay, s")
    repeatability: NotNegative = key(
        0.0,
        "scatter of each joint's stop about its command, which its encoder sees",
        alias="repeatability_mm",
    )
    unseen_repeatability: NotNegative = key(
        0.0,
        "scatter of each joint at each stop beside what its encoder shows, 1 sigma",
        alias="unseen_repeatability_mm",
    )
    growth_per_move: NotNegative = key(
        0.0,
        "share of itself by which either scatter grows with every move, as of a machine that works loose; "
        "0.01: three times as large after 110 moves",
        le=1.0,
    )


class SimulatedJoints(Section):
    """What lies between the simulated encoders and the joints; one number for all six, or six."""

    backlash: SixAlike = key(
        0.0,
        "lost motion of each joint behind its encoder, as after a reversal",
        alias="backlash_mm",
        validate_default=True,
    )


class SimulatedLegs(Section):
    """What the simulated legs do under a load; one number for all six, or six."""

    play_mm: SixAlike = key(
        0.0, "by how much each leg is longer pulled than pushed, mm", validate_default=True
    )
    compliance_um_n: SixAlike = key(
        0.0, "compliance of each leg with its joints, um/N", validate_default=True
    )


class SimulatedLoad(Section):
    """The weight of the simulated platform with what it carries, in the frames of [simulation.geometry]."""

    weight_n: NotNegative = key(0.0, "true weight, N")
    centre_mm: PointInRange | None = key(
        None, "its centre in the platform frame, mm; by default the middle of the joints there"
    )
    direction: Direction = key((0.0, 0.0, -1.0), "where it pulls, in the base frame")


class SimulatedTemperature(Section):
    """How the simulated machine becomes warmer, evenly, from the start of the cell."""

    rise_k: InRange = key(0.0, "by how much in all, K", ge=-200, le=200)
    over_s: Positive = key(3600.0, "within which time, s of cell time; then it stays as warm")
    start_c: InRange = key(
        20.0, 'temperature at the start, deg C, as thermometers with path = "simulated" show it'
    )
    legs_share: SixAlike = key(1.0, "share of the rise that each leg takes", validate_default=True)
    expansion_base_um_m_k: NotNegative = key(
        11.5, "thermal expansion of the base with the scales of linear encoders, um/m/K"
    )
    expansion_platform_um_m_k: NotNegative = key(11.5, "thermal expansion of the platform, um/m/K")
    expansion_legs_um_m_k: NotNegative = key(11.5, "thermal expansion of the legs, um/m/K")


class SoftLimits(Section):
    """What the simulated controller may be commanded to; it refuses any other pose and does not move."""

    lowest: SixInRange = key((-1e6,) * 6, "lowest commands of x, y, z, mm, and a, b, c, deg")
    highest: SixInRange = key((1e6,) * 6, "highest commands of x, y, z, mm, and a, b, c, deg")


class SimulatedFixture(Section):
    """How the simulated fixture of [length_check] is made, and how the gauges are mounted in it."""

    distance_mm: Positive | None = key(
        None, "true distance of the fixture's seats, mm; by default as certified"
    )
    seating_mm: NotNegative = key(0.0, "scatter of the gauges at each mounting, mm, 1 sigma")
    yaw_deg: InRange = key(0.0, "angle of the fixture to its stated direction about base z, deg")
    turned_deg: InRange = key(
        0.0, "turn of the gauges in the second seat about base z, deg; 180: the wrong way round"
    )


class SimulatedFault(Section):
    """A fault that begins at a given time and may end."""

    kind: FaultKind = key(..., "kind of fault")
    device: Text = key(
        "", "faulty device: a gauge's name, encoder 1 to encoder 6, or controller; empty where there is one"
    )
    at_move: int | None = key(
        None,
        "move during which the fault begins, counted from 1; without it, from the start",
        ge=1,
        le=1_000_000,
    )
    after_s: NotNegative = key(0.0, "delay after that, s of cell time")
    lasts_s: Positive | None = key(None, "duration of the fault, s; without it, permanent")


class SimulationSettings(Section):
    """The simulation of a cell."""

    geometry: GeometrySettings = key(..., "true geometry, known to the simulation only")
    seed: Seed = key(1, "random seed of the simulation")
    startup: tuple[StartupWord, ...] = key(
        STARTUP_WORDS,
        "what the program may do to make the simulated controller ready, in place of controller.startup: "
        "it starts in emergency stop, switched off and not homed",
        max_length=len(STARTUP_WORDS),
    )
    station_reach_mm: Positive | None = key(
        None,
        "distance from the gauges beyond which they are moved to the ball at rest, mm; by default 30, or "
        "half of the smallest distance of two points",
    )
    joints_command: tuple[Text, ...] = key(
        (),
        "command that prints six joint variables a line, mm: gauges and encoders are then simulated at "
        "the real controller of [controller]",
    )
    gauges: SimulatedGauges = SimulatedGauges()
    encoders: SimulatedEncoders = SimulatedEncoders()
    motion: SimulatedMotion = SimulatedMotion()
    joints: SimulatedJoints = SimulatedJoints()
    legs: SimulatedLegs = SimulatedLegs()
    load: SimulatedLoad = SimulatedLoad()
    temperature: SimulatedTemperature = SimulatedTemperature()
    soft_limits: SoftLimits = SoftLimits()
    fixture: SimulatedFixture = SimulatedFixture()
    faults: tuple[SimulatedFault, ...] = key((), "faults and their times", max_length=1000)

    @model_validator(mode="after")
    def _legs_need_a_load(self) -> Self:
        if any((*self.legs.play_mm, *self.legs.compliance_um_n)) and not self.load.weight_n:
            raise broken_rule(
                "play and compliance of [simulation.legs] act under a weight, and there is none",
                "Write weight_n into [simulation.load]",
            )
        return self
