"""Views of the devices: what they show now, and what must hold before motion."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.errors import HexacellError, flatten_errors
from hexacell.run_process.messages import (
    ControllerSnapshot,
    EncoderSnapshot,
    GaugeSnapshot,
    LiveSnapshot,
)
from hexacell.text.screens.lines import NEVER
from hexacell.text.screens.views import (
    ChecklistItem,
    ChecklistView,
    DeviceLine,
    GaugeReadout,
    LiveView,
    Mark,
    Urgency,
)
from procedures.run.keys import ThreeNumbers

BAR_COLUMNS = 17
"""Columns of the picture of a plunger in its travel; odd, so that the middle has a place."""

OLD_S = 2.0
"""Silence of a device from which it is shown, s."""

NOT_CONNECTED = "No device is connected."
PRESS_CHECK = (
    "Enter looks at everything, v tries the plan, x takes poses out of it. "
    "s starts a calibration, k a check, K the quick level, r resumes the latest run."
)
PRESS_LENGTH = "l checks the length scale with the fixture, L calibrates and checks it."
CHECKING = "Looking at everything: this takes some seconds, and nothing moves."
RUNNING = "A run goes on: see 3 Measure. Its checks are made again before each step that depends on them."
STARTING = "The run is being started: a process of its own connects to the devices."
NOT_CHECKED_YET = (
    "points and poses within reach",
    "devices answer with the right settings",
    "stop line, disk, and the robot's position",
)
PLAN_UNKNOWN = "v carries the plan out on simulated robots: records, minutes, and predicted accuracy."
TRYING = "Trying the plan on simulated robots, some seconds ..."


def live_view(
    snapshot: LiveSnapshot | None,
    later_s: float = 0.0,
    zero_mm: ThreeNumbers | None = None,
    mounting_mm: float = 1.0,
) -> LiveView:
    """The devices as they show now.

    Args:
        snapshot: their latest values; None without any.
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
        deviation=""
        if shown is None or zero_mm is None
        else f"{gauge.sign * shown - zero_mm['xyz'.index(gauge.axis)]:+.3f}",
        age=age_text(gauge.age_s, later_s),
        noise=noise,
        bar=travel_bar(place, half),
        place=f"? /{half:g}" if place is None else f"{place:+.2f}/{half:g}",
        advice=mounting_advice(gauge, mounting_mm),
        problem=gauge.problem.removeprefix(f"gauge {gauge.name}: "),
    )


def plunger_place(gauge: GaugeSnapshot) -> float | None:
    """How far the plunger is pushed in beyond the middle of its travel, mm; None if not known."""
    if gauge.shown_mm is None or gauge.middle_mm is None:
        return None
    return gauge.shown_mm - gauge.middle_mm


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


def encoder_line(encoders: EncoderSnapshot, later_s: float) -> DeviceLine:
    """The six joint variables."""
    if encoders.problem:
        return DeviceLine("encoders", encoders.problem, Urgency.ALARM)
    if encoders.positions is None:
        return DeviceLine("encoders", "no reading yet")
    positions = " ".join(f"{one:+9.3f}" for one in encoders.positions)
    is_silent = encoders.age_s is None or encoders.age_s + later_s > OLD_S
    age = f", {age_text(encoders.age_s, later_s)} ago" if is_silent else ""
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


def live_items(live: LiveSnapshot | None) -> tuple[ChecklistItem, ...]:
    """An item for each device, from what it shows now."""
    if live is None:
        return (ChecklistItem(Mark.OPEN, "devices", "not connected"),)
    gauges = [
        _device(f"gauge {one.name}", one.problem, "" if one.shown_mm is None else f"{one.shown_mm:+.3f} mm")
        for one in live.gauges
    ]
    found = "" if live.encoders.positions is None else "six positions"
    encoders = _device("encoders", live.encoders.problem, found)
    stop = ChecklistItem(Mark.DONE, "stop line", "motion is allowed")
    if live.stop_reason:
        stop = ChecklistItem(Mark.FAILED, "stop line", live.stop_reason, "Release it")
    return (*gauges, encoders, _controller(live), stop)


def _device(name: str, problem: str, found: str) -> ChecklistItem:
    if problem:
        return ChecklistItem(Mark.FAILED, name, problem.removeprefix(f"{name}: "))
    return ChecklistItem(Mark.DONE, name, found) if found else ChecklistItem(Mark.BUSY, name, "waited for")


def _controller(live: LiveSnapshot) -> ChecklistItem:
    controller = live.controller
    if controller.problem:
        return ChecklistItem(Mark.FAILED, "controller", controller.problem)
    if controller.estop is None:
        return ChecklistItem(Mark.BUSY, "controller", "waited for")
    if controller.estop:
        return ChecklistItem(
            Mark.DONE, "controller", "answers; in emergency stop, asked about at the start"
        )
    return ChecklistItem(Mark.DONE, "controller", "answers")


def failed_items(error: HexacellError) -> tuple[ChecklistItem, ...]:
    """An item for each failure in a report."""
    return tuple(
        ChecklistItem(Mark.FAILED, one.subject or "plan", one.problem, one.action or "")
        for one in flatten_errors(error)
    )


def passed_items(devices: Sequence[str]) -> tuple[ChecklistItem, ...]:
    """The items of a preflight that found nothing; ``devices`` are those that answered."""
    named = (ChecklistItem(Mark.DONE, line) for line in devices)
    return (*named, *(ChecklistItem(Mark.DONE, name) for name in NOT_CHECKED_YET))


def checklist_view(
    live: LiveSnapshot | None,
    checked: tuple[ChecklistItem, ...] | None,
    plan: tuple[str, ...],
    *,
    is_checking: bool = False,
    refusal: str = "",
    has_fixture: bool = False,
) -> ChecklistView:
    """The whole list; ``checked`` is what the preflight found, None before it.

    ``has_fixture`` is whether the cell can check its length scale.
    """
    if checked is None:
        mark = Mark.BUSY if is_checking else Mark.OPEN
        checked = tuple(ChecklistItem(mark, name) for name in NOT_CHECKED_YET)
    press = f"{PRESS_CHECK} {PRESS_LENGTH}" if has_fixture else PRESS_CHECK
    instruction = CHECKING if is_checking else refusal or press
    return ChecklistView((*live_items(live), *checked), plan or (PLAN_UNKNOWN,), instruction, refusal)
