"""The section of a simulated cell: its true geometry, motion, noise and faults."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hexacell.cell.controller import STARTUP_WORDS, StartupWord
from hexacell.cell.fields import (
    GeometrySettings,
    InRange,
    NotNegative,
    Positive,
    Section,
    Seed,
    SixInRange,
    Text,
)

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
]


class SimulatedGauges(Section):
    """How the simulated dial indicators behave."""

    noise_mm: NotNegative = Field(0.01, description="noise drawn at every stop of the robot, mm, 1 sigma")
    flicker_mm: NotNegative = Field(0.001, description="noise drawn at every reading, mm, 1 sigma")
    latency_s: NotNegative = Field(0.02, description="time between request and answer, s")
    baudrate: int | None = Field(
        None, ge=300, le=10_000_000, description="speed of the line, baud; by default the protocol's"
    )
    transport: Literal["pty", "socket"] = Field("pty", description="how the gauges' lines are simulated")
    misalignment_deg: NotNegative = Field(
        0.0, description="misalignment of the triad at each station, deg, 1 sigma"
    )
    placing_mm: NotNegative = Field(
        0.25, description="distance from mid-travel at which gauges are placed, mm, 1 sigma"
    )
    off_middle_mm: tuple[InRange, InRange, InRange] = Field(
        (0.0, 0.0, 0.0),
        description="constant distance of the ball from mid-travel along x, y, z beside that, mm",
    )


class SimulatedEncoders(Section):
    """How the simulated CANopen encoders behave."""

    noise: NotNegative = Field(
        0.01, alias="noise_mm", description="noise drawn at every stop of the robot, 1 sigma"
    )
    flicker: NotNegative = Field(
        0.001, alias="flicker_mm", description="noise drawn at every sample, 1 sigma"
    )
    latency_s: NotNegative = Field(0.001, description="time between SYNC and the last answer, s")
    common_scale_um_m: InRange = Field(
        0.0, ge=-1e5, le=1e5, description="scale error that all encoders have alike, um/m"
    )


class SimulatedMotion(Section):
    """How the simulated robot moves."""

    speed: Positive = Field(
        100.0, alias="speed_mm_s", description="speed of the fastest joint, however short a move is to be"
    )
    minimum_s: NotNegative = Field(0.3, description="shortest duration of a move, s")
    ringing_mm: NotNegative = Field(0.2, description="amplitude of the ball's oscillation on arrival, mm")
    ringing_s: Positive = Field(0.15, description="time constant of that oscillation's decay, s")
    repeatability: NotNegative = Field(
        0.0, alias="repeatability_mm", description="scatter of each joint's stop, 1 sigma"
    )


class SoftLimits(Section):
    """What the simulated controller may be commanded to; it refuses any other pose and does not move."""

    lowest: SixInRange = Field((-1e6,) * 6, description="lowest commands of x, y, z, mm, and a, b, c, deg")
    highest: SixInRange = Field((1e6,) * 6, description="highest commands of x, y, z, mm, and a, b, c, deg")


class SimulatedFixture(Section):
    """How the simulated fixture of [length_check] is made, and how the gauges are mounted in it."""

    distance_mm: Positive | None = Field(
        None, description="true distance of the fixture's seats, mm; by default as certified"
    )
    seating_mm: NotNegative = Field(0.0, description="scatter of the gauges at each mounting, mm, 1 sigma")
    yaw_deg: InRange = Field(
        0.0, description="angle of the fixture to its stated direction about base z, deg"
    )
    turned_deg: InRange = Field(
        0.0, description="turn of the gauges in the second seat about base z, deg; 180: the wrong way round"
    )


class SimulatedFault(Section):
    """A fault that begins at a given time and may end."""

    kind: FaultKind = Field(description="kind of fault")
    device: Text = Field(
        "",
        description="faulty device: a gauge's name, encoder 1 to encoder 6, or controller; empty where "
        "there is one",
    )
    at_move: int | None = Field(
        None,
        ge=1,
        le=1_000_000,
        description="move during which the fault begins, counted from 1; without it, from the start",
    )
    after_s: NotNegative = Field(0.0, description="delay after that, s of cell time")
    lasts_s: Positive | None = Field(None, description="duration of the fault, s; without it, permanent")


class SimulationSettings(Section):
    """The simulation of a cell."""

    geometry: GeometrySettings = Field(description="true geometry, known to the simulation only")
    seed: Seed = Field(1, description="random seed of the simulation")
    startup: tuple[StartupWord, ...] = Field(
        STARTUP_WORDS,
        max_length=len(STARTUP_WORDS),
        description="what the program may do to make the simulated controller ready, in place of "
        "controller.startup: it starts in emergency stop, switched off and not homed",
    )
    station_reach_mm: Positive = Field(
        30.0, description="distance from the gauges beyond which they are moved to the ball at rest, mm"
    )
    joints_command: tuple[Text, ...] = Field(
        (),
        description="command that prints six joint variables a line, mm: gauges and encoders are then "
        "simulated at the real controller of [controller]",
    )
    gauges: SimulatedGauges = SimulatedGauges()
    encoders: SimulatedEncoders = SimulatedEncoders()
    motion: SimulatedMotion = SimulatedMotion()
    soft_limits: SoftLimits = SoftLimits()
    fixture: SimulatedFixture = SimulatedFixture()
    faults: tuple[SimulatedFault, ...] = Field((), max_length=1000, description="faults and their times")
