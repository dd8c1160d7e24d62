"""Text for what the devices show now: reading, unit, age and noise, and the plunger in its travel."""

from __future__ import annotations

from hexacell.run_process.snapshots import (
    ControllerSnapshot,
    EncoderSnapshot,
    GaugeSnapshot,
    LiveSnapshot,
)
from hexacell.text.screens.lines import NEVER
from hexacell.text.screens.views import DeviceLine, GaugeReadout, LiveView, Urgency
from procedures.run.steps import ThreeNumbers

BAR_COLUMNS = 17
"""Of the picture of a plunger in its travel; odd, so that the middle has a place."""

OLD_S = 2.0
"""A device that is silent for longer is said to be."""

NOT_CONNECTED = "No device is connected."


def live_view(
    snapshot: LiveSnapshot | None,
    later_s: float = 0.0,
    zero_mm: ThreeNumbers | None = None,
    mounting_mm: float = 1.0,
) -> LiveView:
    """The devices as they show now.

    Args:
        snapshot: their latest values; none where there are none.
        later_s: how long ago these came.
        zero_mm: what the gauges showed along base x, y, z when they were zeroed.
        mounting_mm: how far from its middle a plunger may stand when gauges are placed.
    """
    if snapshot is None:
        return LiveView(note=NOT_CONNECTED)
    gauges = tuple(gauge_readout(one, later_s, zero_mm, mounting_mm) for one in snapshot.gauges)
    devices = [encoder_line(snapshot.encoders, later_s), controller_line(snapshot.controller, later_s)]
    if snapshot.stop_reason:
        devices.append(DeviceLine("stop line", f"NO MOTION: {snapshot.stop_reason}", Urgency.ALARM))
    return LiveView(gauges, tuple(devices))


def gauge_readout(
    gauge: GaugeSnapshot, later_s: float, zero_mm: ThreeNumbers | None, mounting_mm: float
) -> GaugeReadout:
    """One gauge."""
    shown, place, half = gauge.shown_mm, plunger_place(gauge), gauge.travel_mm / 2.0
    noise = f"{1e3 * gauge.noise_mm:.1f} um" if gauge.noise_mm is not None else "-"
    return GaugeReadout(
        name=gauge.name,
        axis=gauge.axis,
        reading="-" if shown is None else f"{shown:+.4f}",
        unit=gauge.unit,
        deviation=_deviation(gauge, zero_mm),
        age=age_text(gauge.age_s, later_s),
        noise=noise,
        bar=travel_bar(place, half),
        place=f"? /{half:g}" if place is None else f"{place:+.2f}/{half:g}",
        advice=mounting_advice(gauge, mounting_mm),
        problem=gauge.problem.removeprefix(f"gauge {gauge.name}: "),
    )


def plunger_place(gauge: GaugeSnapshot) -> float | None:
    """How far the plunger is pushed in beyond the middle of its travel, mm; none where nobody knows."""
    if gauge.shown_mm is None or gauge.middle_mm is None:
        return None
    return gauge.shown_mm - gauge.middle_mm


def _deviation(gauge: GaugeSnapshot, zero_mm: ThreeNumbers | None) -> str:
    """Along the base axis, from the zero of the set."""
    if gauge.shown_mm is None or zero_mm is None:
        return ""
    return f"{gauge.sign * gauge.shown_mm - zero_mm['xyz'.index(gauge.axis)]:+.3f}"


def mounting_advice(gauge: GaugeSnapshot, mounting_mm: float) -> str:
    """What to do with a gauge that is being placed."""
    if gauge.problem or gauge.shown_mm is None:
        return f"the {gauge.name} gauge does not answer"
    place = plunger_place(gauge)
    if place is None:
        return f"set the {gauge.name} plunger to mid travel by eye"
    if abs(place) <= mounting_mm:
        return f"ok, {abs(place):.1f} mm from mid travel"
    # A plunger that is pushed in too far has to be moved away from the ball.
    direction = "out" if place > 0.0 else "in"
    side = "+" if place * gauge.sign > 0.0 else "-"
    return f"move the {gauge.name} gauge {abs(place):.1f} mm {direction} (along {side}{gauge.axis})"


def travel_bar(place_mm: float | None, half_mm: float) -> str:
    """A plunger in its travel: the middle is marked, ``o`` is where it stands."""
    middle = BAR_COLUMNS // 2
    cells = ["-"] * BAR_COLUMNS
    cells[middle] = "+"
    if place_mm is not None:
        share = max(-1.0, min(1.0, place_mm / half_mm))
        cells[middle + round(share * middle)] = "O"
    return f"[{''.join(cells)}]"


def age_text(age_s: float | None, later_s: float) -> str:
    """How long ago a device answered."""
    if age_s is None:
        return NEVER
    age = age_s + later_s
    return f"{age:.1f} s" if age < 99.95 else "> 99 s"


def _is_silent(age_s: float | None, later_s: float) -> bool:
    return age_s is None or age_s + later_s > OLD_S


def encoder_line(encoders: EncoderSnapshot, later_s: float) -> DeviceLine:
    """The six joint variables."""
    if encoders.problem:
        return DeviceLine("encoders", encoders.problem, Urgency.ALARM)
    if encoders.positions is None:
        return DeviceLine("encoders", "no reading yet")
    positions = " ".join(f"{one:+9.3f}" for one in encoders.positions)
    silent = _is_silent(encoders.age_s, later_s)
    age = f", {age_text(encoders.age_s, later_s)} ago" if silent else ""
    return DeviceLine("encoders", f"{positions} {encoders.unit}{age}")


def controller_line(controller: ControllerSnapshot, later_s: float) -> DeviceLine:
    """Whether the controller may move."""
    if controller.problem:
        return DeviceLine("controller", controller.problem, Urgency.ALARM)
    if controller.estop is None:
        return DeviceLine("controller", "no answer yet")
    said = "; ".join(controller.error_messages)
    messages = f"; {said}" if said else ""
    if controller.estop:
        return DeviceLine("controller", f"EMERGENCY STOP{messages}", Urgency.ALARM)
    state = "on, may move" if controller.enabled else "off"
    return DeviceLine("controller", f"{state}, {age_text(controller.age_s, later_s)} ago{messages}")
