"""Text for the devices and the plan before motion: what they show now, what must hold, where it leads.

In the list of planned poses a key excludes what the robot must not be sent to.
"""

from collections.abc import Iterator, Sequence

from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.cell.model import CellSettings
from hexacell.dry_run.campaign import VisitedPose
from hexacell.errors import HexacellError, flatten_errors
from hexacell.run_process.messages import GaugeSnapshot, LiveSnapshot, Shown
from hexacell.text.screens.views import ChecklistItem, Line, Mark, Urgency
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


def device_lines(
    snapshot: LiveSnapshot | None,
    later_s: float = 0.0,
    zero_mm: ThreeNumbers | None = None,
    mounting_mm: float | None = None,
) -> list[Line]:
    """A line for each device, as it shows now.

    Args:
        snapshot: their latest values; None without any.
        later_s: how long ago these came.
        zero_mm: what the gauges showed along base x, y, z when they were zeroed.
        mounting_mm: how far from its middle a plunger may stand while gauges are placed; then only they
            are shown, each with how it is to be moved.
    """
    if snapshot is None:
        return [(NOT_CONNECTED, Urgency.CALM)]
    gauges = [
        (_gauge_line(one, later_s, zero_mm, mounting_mm), urgency_of(one.problem))
        for one in snapshot.gauges
    ]
    if mounting_mm is not None:
        return gauges
    lines = [
        *gauges,
        _encoder_line(snapshot.encoders, later_s),
        _controller_line(snapshot.controller, later_s),
    ]
    if snapshot.stop_reason:
        lines.append((f"stop line  NO MOTION: {snapshot.stop_reason}", Urgency.ALARM))
    return lines


def urgency_of(problem: str) -> Urgency:
    """Alarm where a device does not answer."""
    return Urgency.ALARM if problem else Urgency.CALM


def _gauge_line(
    gauge: GaugeSnapshot, later_s: float, zero_mm: ThreeNumbers | None, mounting_mm: float | None
) -> str:
    """A gauge in at most 80 columns, or why it does not answer."""
    name = gauge.name if gauge.name == gauge.axis else f"{gauge.name} ({gauge.axis})"
    age = age_text(gauge.age_s, later_s)
    if gauge.problem:
        since = "" if gauge.age_s is None else f" for {age}"
        return f"{name:4}NO READING{since}: {gauge.problem.removeprefix(f'gauge {gauge.name}: ')}"
    reading = "-" if gauge.shown_mm is None else f"{gauge.shown_mm:+.4f}"
    place, half = plunger_place(gauge), gauge.travel_mm / 2.0
    start, bar = f"{name:4}{reading:>9} {gauge.unit}", travel_bar(place, half)
    if mounting_mm is not None:
        return f"{start}  {bar}  {mounting_advice(gauge, mounting_mm)}"
    moved = gauge_deviation(gauge, zero_mm)
    deviation = " " * 11 if moved is None else f"  d {moved:>+7.3f}"
    noise = f"{1e3 * gauge.noise_mm:.1f} um" if gauge.noise_mm is not None else "-"
    stands = f"? /{half:g}" if place is None else f"{place:+.2f}/{half:g}"
    return f"{start}{deviation}{age:>7}{noise:>9} {bar} {stands}"


def gauge_deviation(gauge: GaugeSnapshot, zero_mm: ThreeNumbers | None) -> float | None:
    """A gauge's reading along its base axis from the zero of the set, mm; None without either."""
    if gauge.shown_mm is None or zero_mm is None:
        return None
    return gauge.sign * gauge.shown_mm - zero_mm["xyz".index(gauge.axis)]


def gauge_figure(gauge: GaugeSnapshot, zero_mm: ThreeNumbers | None) -> str:
    """The axis of a gauge and its deviation from the zero of the set, without one its reading."""
    moved = gauge_deviation(gauge, zero_mm)
    if gauge.problem:
        return f"{gauge.axis} - - -"
    if moved is not None:
        return f"{gauge.axis} {moved:+.3f}"
    return f"{gauge.axis} " + ("" if gauge.shown_mm is None else f"{gauge.shown_mm:+.4f}"[:-1])


def plunger_place(gauge: GaugeSnapshot) -> float | None:
    """How far the plunger is pushed in beyond the middle of its travel, mm; None if not known."""
    if gauge.shown_mm is None or gauge.middle_mm is None:
        return None
    return gauge.shown_mm - gauge.middle_mm


def mounting_advice(gauge: GaugeSnapshot, mounting_mm: float) -> str:
    """What to do with a gauge that is being placed."""
    if gauge.problem or gauge.shown_mm is None:
        return f"the {gauge.name} gauge does not answer"
    if (place := plunger_place(gauge)) is None:
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
        return "never"
    age = age_s + later_s
    return f"{age:.1f} s" if age < 99.95 else "> 99 s"


def _encoder_line(encoders: Shown[EncoderSample], later_s: float) -> Line:
    text = encoders.problem or "no reading yet"
    if not encoders.problem and (sample := encoders.value) is not None:
        positions = " ".join(f"{one:+9.3f}" for one in sample.positions)
        is_silent = encoders.age_s is None or encoders.age_s + later_s > OLD_S
        age = f", {age_text(encoders.age_s, later_s)} ago" if is_silent else ""
        text = f"{positions} {sample.unit}{age}"
    return f"{'encoders':11}{text}", urgency_of(encoders.problem)


def _controller_line(controller: Shown[ControllerStatus], later_s: float) -> Line:
    text, urgency = controller.problem or "no answer yet", urgency_of(controller.problem)
    if not controller.problem and (status := controller.value) is not None:
        said = "".join(f"; {message}" for message in status.error_messages)
        state = "on, may move" if status.enabled else "off"
        text = f"{state}, {age_text(controller.age_s, later_s)} ago{said}"
        if status.estop:
            text, urgency = f"EMERGENCY STOP{said}", Urgency.ALARM
    return f"{'controller':11}{text}", urgency


def live_items(live: LiveSnapshot | None) -> tuple[ChecklistItem, ...]:
    """An item for each device, from what it shows now."""
    if live is None:
        return (ChecklistItem(Mark.OPEN, "devices", "not connected"),)
    gauges = [
        _device(f"gauge {one.name}", one.problem, "" if one.shown_mm is None else f"{one.shown_mm:+.3f} mm")
        for one in live.gauges
    ]
    found = "" if live.encoders.value is None else "six positions"
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
    return ChecklistItem(Mark.DONE, name, found) if found else ChecklistItem(Mark.BUSY, name, "waited for")


def failed_items(error: HexacellError) -> tuple[ChecklistItem, ...]:
    """An item for each failure in a report."""
    return tuple(
        ChecklistItem(Mark.FAILED, one.subject or "plan", one.problem, one.action or "")
        for one in flatten_errors(error)
    )


def checked_items(mark: Mark, devices: Sequence[str] = ()) -> tuple[ChecklistItem, ...]:
    """How all items of a preflight stand that fails nowhere; ``devices`` are those that answered."""
    return tuple(ChecklistItem(mark, name) for name in (*devices, *NOT_CHECKED_YET))


NOT_TRIED = "v in 2 Preflight tries the plan; then its poses are here."
EVERYTHING = "These poses were measured on a simulated robot; a real one is sent to others near them."


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
