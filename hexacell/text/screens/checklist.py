"""What must hold before motion, the plan, and the poses of it that a cell file excludes."""

from collections.abc import Iterator, Sequence

from hexacell.cell.model import CellSettings
from hexacell.dry_run.campaign import VisitedPose
from hexacell.errors import HexacellError, flatten_errors
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.text.screens.views import ChecklistItem, Mark

NOT_CHECKED_YET = (
    "points and poses within reach",
    "devices answer with the right settings",
    "stop line, disk, and the robot's position",
)
PLAN_UNKNOWN = "v carries the plan out on simulated robots: records, minutes, and predicted accuracy."
TRYING = "Trying the plan on simulated robots, some seconds ..."


def live_items(live: LiveSnapshot | None, *, is_checking: bool) -> tuple[ChecklistItem, ...]:
    """An item for each device, from what it shows now; the check has them while it looks."""
    if live is None:
        finding = "being looked at" if is_checking else "not connected"
        return (ChecklistItem(Mark.BUSY if is_checking else Mark.OPEN, "devices", finding),)
    gauges = [
        _device(f"gauge {one.name}", one.problem, "" if one.shown_mm is None else f"{one.shown_mm:+.3f} mm")
        for one in live.gauges
    ]
    sample = live.encoders.value
    found = "" if sample is None else f"{len(sample.positions)} positions"
    encoders = _device("encoders", live.encoders.problem, found)
    status = live.controller.value
    stopped = "; in emergency stop, asked about at the start" if status and status.estop else ""
    answer = "" if status is None else f"answers{stopped}"
    controller = _device("controller", live.controller.problem, answer)
    stop = ChecklistItem(Mark.DONE, "stop line", "motion is allowed")
    if live.stop_reason:
        stop = ChecklistItem(Mark.FAILED, "stop line", live.stop_reason, "Release it")
    return (*gauges, encoders, controller, stop)


def _device(name: str, problem: str, found: str) -> ChecklistItem:
    if problem:
        return ChecklistItem(Mark.FAILED, name, problem.removeprefix(f"{name}: "))
    return (
        ChecklistItem(Mark.DONE, name, found) if found else ChecklistItem(Mark.BUSY, name, "no answer yet")
    )


def failed_items(error: HexacellError) -> tuple[ChecklistItem, ...]:
    """An item for each failure in a report."""
    return tuple(
        ChecklistItem(Mark.FAILED, one.subject or "plan", one.problem, one.action or "")
        for one in flatten_errors(error)
    )


def checked_items(mark: Mark, devices: Sequence[str] = ()) -> tuple[ChecklistItem, ...]:
    """How all items of a preflight stand that fails nowhere; ``devices`` are those that answered."""
    place, settings, rest = NOT_CHECKED_YET
    known = f"{len(devices)} identities, i shows them" if devices else ""
    return (
        ChecklistItem(mark, place),
        ChecklistItem(mark, settings, known, details=tuple(devices)),
        ChecklistItem(mark, rest),
    )


def summary(items: Sequence[ChecklistItem]) -> str:
    """How many of the items hold."""
    counted = {mark: sum(one.mark is mark for one in items) for mark in Mark}
    parts = [f"{counted[Mark.DONE]} hold"]
    parts += [f"{counted[Mark.FAILED]} do not"] if counted[Mark.FAILED] else []
    left = counted[Mark.OPEN] + counted[Mark.BUSY]
    return ", ".join([*parts, *([f"{left} to be looked at"] if left else [])])


NOT_TRIED = "v in 2 Preflight tries the plan; then its poses are here."
EVERYTHING = "Nothing moves here. A run will go near these poses; exclude those that it must not."


def plan_note(planned: Sequence[VisitedPose], *, is_trying: bool) -> str:
    """Where the poses of the plan come from, or why there are none."""
    notes = [EVERYTHING] if planned else [] if is_trying else [NOT_TRIED]
    return " ".join([*notes, *([TRYING] if is_trying else [])])


def plan_rows(settings: CellSettings, planned: Sequence[VisitedPose]) -> Iterator[tuple[str, str]]:
    """Name and line of each exclusion of the cell file and, once the plan was tried, of its poses."""
    points = settings.identification.points
    for number, one in enumerate(settings.exclusions, start=1):
        if one.pose is None:
            what = f"point {one.point}, {_place(points[(one.point or 1) - 1])}"
        else:
            what = " ".join(f"{axis} {value:.1f}" for axis, value in zip("xyzabc", one.pose, strict=True))
            what += f", within {one.within_mm:g} mm, {one.within_deg:g} deg" if one.within_deg else ""
        yield f"e{number}", f"OUT  e{number}  {what}"
    if not planned:
        return
    excluded = settings.excluded_commands
    for number, position in enumerate(points, start=1):
        if number in settings.excluded_points:
            continue
        here = [one for one in planned if one[0] == number and excluded.allows(one[2].as_tuple())]
        yield str(number), f"     point {number}, {_place(position)}: {len(here)} records"
        for _, orientation, pose in here:
            name = f"{number}.{orientation}"
            reference = "  reference" if orientation == 1 else ""
            angles = zip("abc", pose.as_tuple()[3:], strict=True)
            shown = "  ".join(f"{axis} {value:6.1f}" for axis, value in angles)
            yield name, f"     {name:>7}  {shown} deg{reference}"


def plan_lines(settings: CellSettings, tried: Sequence[str], *, is_trying: bool) -> list[str]:
    """How much the cell file excludes, and what the plan is expected to give."""
    lines = (exclusions_text(settings), *([TRYING] if is_trying else tried))
    return list(filter(None, lines)) or [PLAN_UNKNOWN]


def exclusions_text(settings: CellSettings) -> str:
    """How much the cell file excludes; empty if nothing."""
    points = [f"point {point}" for point in sorted(settings.excluded_points)]
    poses = len(settings.excluded_commands.commands)
    parts = [*([f"{poses} pose{'s' * (poses > 1)}"] if poses else []), *points]
    return f"Excluded by the cell file: {', '.join(parts)}." if parts else ""


def _place(pose: Sequence[float]) -> str:
    return "  ".join(f"{axis} {value:.1f}" for axis, value in zip("xyz", pose[:3], strict=True))
