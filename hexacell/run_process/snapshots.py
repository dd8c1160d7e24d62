"""What the devices show now, as one message: for screens, never for records."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hexacell.cell.fields import Frozen
from hexacell.kinematics.parameters import JointUnit

SnapshotAge = float | None
"""How long ago a device answered, s; none before its first answer."""


class GaugeSnapshot(Frozen):
    """One gauge, mm in its own zero and direction.

    Attributes:
        axis: the base axis along which its plunger moves.
        sign: 1 where its reading grows along the positive axis, else -1.
        shown_mm: its latest reading; none before the first one.
        unit: of the display; a gauge that shows another one is refused, and ``problem`` says so.
        noise_mm: standard deviation of its latest readings at standstill; none before there are some.
        problem: why it did not answer since; empty if it did.
        travel_mm: its measuring range.
        middle_mm: what it shows in the middle of that; none where its display does not tell.
    """

    name: str
    axis: Literal["x", "y", "z"]
    sign: Literal[1, -1] = 1
    shown_mm: float | None = None
    unit: Literal["mm"] = "mm"
    age_s: SnapshotAge = None
    noise_mm: float | None = None
    problem: str = ""
    travel_mm: float
    middle_mm: float | None = None


class EncoderSnapshot(Frozen):
    """The six joint variables in their unit; none before the first answer."""

    positions: tuple[float, ...] | None = None
    unit: JointUnit = JointUnit.MM
    age_s: SnapshotAge = None
    problem: str = ""


class ControllerSnapshot(Frozen):
    """The state of the controller; ``estop`` and ``enabled`` are none before its first answer."""

    estop: bool | None = None
    enabled: bool | None = None
    error_messages: tuple[str, ...] = ()
    age_s: SnapshotAge = None
    problem: str = ""


class LiveSnapshot(Frozen):
    """The latest values of all devices; at most ten a second, and none is kept for a slow reader.

    ``stop_reason`` is why motion is forbidden, empty while it is not.
    """

    kind: Literal["live"] = "live"
    gauges: tuple[GaugeSnapshot, ...]
    encoders: EncoderSnapshot = Field(default_factory=EncoderSnapshot)
    controller: ControllerSnapshot = Field(default_factory=ControllerSnapshot)
    stop_reason: str = ""
