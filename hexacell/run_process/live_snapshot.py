"""What the devices showed at one moment, for screens; never for records."""

from typing import Generic, Literal, TypeVar

from pydantic import Field

from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.cell.fields import Frozen

Value = TypeVar("Value")


class Shown(Frozen, Generic[Value]):
    """What a device showed last, how long ago, s, and why it did not answer since; empty if it did.

    Value and age are None before its first answer.
    """

    value: Value | None = None
    age_s: float | None = None
    problem: str = ""


class GaugeSnapshot(Frozen):
    """One gauge, mm in its own zero and direction.

    Attributes:
        axis: the base axis along which its plunger moves.
        sign: 1 where its reading grows along the positive axis, else -1.
        shown_mm: its latest reading; None before the first one.
        unit: the display's unit; a gauge that shows another one is refused, and ``problem`` says so.
        noise_mm: standard deviation of its latest readings at standstill; None before there are some.
        travel_mm: its measuring range.
        middle_mm: what it shows in the middle of that; None where its display does not say.
    """

    name: str
    axis: Literal["x", "y", "z"]
    sign: Literal[1, -1] = 1
    shown_mm: float | None = None
    unit: Literal["mm"] = "mm"
    age_s: float | None = None
    noise_mm: float | None = None
    problem: str = ""
    travel_mm: float
    middle_mm: float | None = None


class LiveSnapshot(Frozen):
    """The latest values of all devices; at most ten a second, and none is kept for a slow reader.

    ``stop_reason`` is why motion is forbidden, empty while it is not.
    """

    kind: Literal["live"] = "live"
    gauges: tuple[GaugeSnapshot, ...]
    encoders: Shown[EncoderSample] = Field(default_factory=Shown[EncoderSample])
    controller: Shown[ControllerStatus] = Field(default_factory=Shown[ControllerStatus])
    stop_reason: str = ""

    @property
    def is_complete(self) -> bool:
        """Whether every device has shown something, or why it does not."""
        others = [(one.value is not None, one.problem) for one in (self.encoders, self.controller)]
        gauges = [(one.shown_mm is not None, one.problem) for one in self.gauges]
        return all(is_shown or problem for is_shown, problem in others + gauges)
