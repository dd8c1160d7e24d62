"""Text for what must hold before motion: devices from their live values, the rest from a preflight."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.errors import HexacellError, flatten_errors
from hexacell.run_process.snapshots import LiveSnapshot
from hexacell.text.screens.views import ChecklistItem, ChecklistView, Mark

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
    """The whole list; ``checked`` is what the preflight found, none before it.

    ``has_fixture`` is whether the cell can check its length scale.
    """
    if checked is None:
        mark = Mark.BUSY if is_checking else Mark.OPEN
        checked = tuple(ChecklistItem(mark, name) for name in NOT_CHECKED_YET)
    press = f"{PRESS_CHECK} {PRESS_LENGTH}" if has_fixture else PRESS_CHECK
    instruction = CHECKING if is_checking else refusal or press
    return ChecklistView((*live_items(live), *checked), plan or (PLAN_UNKNOWN,), instruction, refusal)
