"""A cell and its devices: what its file states, and what they show now: a card each, a line a gauge."""

from collections.abc import Iterator
from itertools import zip_longest

from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.cell.loader import Cell
from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot, Shown
from hexacell.text.screens.views import Card, Line, Urgency
from procedures.run.keys import ThreeNumbers

BAR_COLUMNS = 21
"""Columns of the picture of a plunger in its travel; odd, so that the middle has a place."""

WIDE_BAR = 33
"""Of one that is read from afar."""

OLD_S = 2.0
"""Silence of a device from which it is shown, s."""


def cell_facts(cell: Cell) -> Iterator[str]:
    """A line each: what there is, what is measured, and what must be reached."""
    settings = cell.settings
    controller, plan, limits = settings.controller, settings.identification, settings.acceptance
    yield f"robot       {settings.robot.mechanism}"
    yield f"controller  {controller.protocol}"
    yield f"its config  {', '.join(one.name for one in cell.config_paths)}"
    gauges = ", ".join(
        f"{'+' if one.sign > 0 else '-'}{one.axis} {one.protocol}" for one in settings.gauges
    )
    yield f"gauges      {gauges}"
    yield f"encoders    {settings.encoders.protocol}"
    yield f"plan        {len(plan.points)} points, {plan.orientations} orientations each"
    yield f"limit       {limits.position_mm:g} mm and {limits.orientation_deg:g} deg at the task poses"


def device_cards(live: LiveSnapshot | None, later_s: float) -> tuple[Card, ...]:
    """A card for each gauge, for the encoders, the controller and the stop line.

    Args:
        live: their latest values; None without any.
        later_s: how long ago these came.
    """
    if live is None:
        return ()
    stop = Card("stop line", "free", Urgency.GOOD, "motion is allowed")
    if live.stop_reason:
        stop = Card("stop line", "NO MOTION", Urgency.ALARM, "stopped", (live.stop_reason,))
    gauges = [_gauge_card(one, later_s) for one in live.gauges]
    return (
        *gauges,
        _encoder_card(live.encoders, later_s),
        _controller_card(live.controller, later_s),
        stop,
    )


def _gauge_card(gauge: GaugeSnapshot, later_s: float) -> Card:
    title = f"gauge {gauge.name}" if gauge.name == gauge.axis else f"gauge {gauge.name} along {gauge.axis}"
    age = age_text(gauge.age_s, later_s)
    if gauge.problem or gauge.shown_mm is None:
        return _without_value(title, "NO READING", gauge.problem.removeprefix(f"gauge {gauge.name}: "), age)
    place, half = plunger_place(gauge), gauge.travel_mm / 2.0
    stands = "mid travel not known" if place is None else f"{place:+.2f} of ±{half:g} mm travel"
    noise = "noise not known yet" if gauge.noise_mm is None else f"noise {1e3 * gauge.noise_mm:.1f} um"
    lines = (travel_bar(place, half), stands, f"{noise}, {age}")
    return Card(title, "ok", Urgency.GOOD, f"{gauge.shown_mm:+.4f} {gauge.unit}", lines)


def _without_value(title: str, state: str, problem: str, age: str) -> Card:
    """A device that has a problem, or has not answered yet."""
    if not problem:
        return Card(title, "waiting", Urgency.ATTENTION, "- - -")
    return Card(title, state, Urgency.ALARM, "- - -", (problem, f"last answer {age}"))


def _encoder_card(encoders: Shown[EncoderSample], later_s: float) -> Card:
    age = age_text(encoders.age_s, later_s)
    if encoders.problem or (sample := encoders.value) is None:
        return _without_value("encoders", "NO READING", encoders.problem, age)
    numbered = [f"{number} {position:+8.2f}" for number, position in enumerate(sample.positions, start=1)]
    rows = (len(numbered) + 1) // 2
    pairs = zip_longest(numbered[:rows], numbered[rows:], fillvalue="")
    lines = [f"{left}  {right}".rstrip() for left, right in pairs]
    return Card("encoders", "ok", Urgency.GOOD, f"positions, {sample.unit}", (*lines, age))


def _controller_card(controller: Shown[ControllerStatus], later_s: float) -> Card:
    age = age_text(controller.age_s, later_s)
    if controller.problem or (status := controller.value) is None:
        return _without_value("controller", "NO ANSWER", controller.problem, age)
    said = tuple(status.error_messages)
    if status.estop:
        return Card("controller", "EMERGENCY STOP", Urgency.ALARM, "emergency stop", (*said, age))
    figure, urgency = ("switched on", Urgency.GOOD) if status.enabled else ("off", Urgency.ATTENTION)
    return Card("controller", "ok" if status.enabled else "off", urgency, figure, (*said, age))


def gauge_lines(
    live: LiveSnapshot | None, later_s: float = 0.0, zero_mm: ThreeNumbers | None = None
) -> list[Line]:
    """A line for each gauge, and one for what else does not answer.

    Args:
        live: the latest values; None without any.
        later_s: how long ago these came.
        zero_mm: what the gauges showed along base x, y, z when they were zeroed.
    """
    if live is None:
        return [("Nothing is read now.", Urgency.CALM)]
    lines = [(_gauge_line(one, later_s, zero_mm), urgency_of(one.problem)) for one in live.gauges]
    encoders, controller = _encoder_card(live.encoders, later_s), _controller_card(live.controller, later_s)
    others = [
        f"{card.title} {card.state} ({card.lines[-1] if card.lines else '-'})"
        for card in (encoders, controller)
    ]
    urgency = max((encoders.urgency, controller.urgency), key=list(Urgency).index)
    lines.append((", ".join(others), Urgency.CALM if urgency is Urgency.GOOD else urgency))
    if live.stop_reason:
        lines.append((f"stop line NO MOTION: {live.stop_reason}", Urgency.ALARM))
    return lines


def urgency_of(problem: str) -> Urgency:
    """Alarm where a device does not answer."""
    return Urgency.ALARM if problem else Urgency.CALM


def _gauge_line(gauge: GaugeSnapshot, later_s: float, zero_mm: ThreeNumbers | None) -> str:
    """A gauge in at most 78 columns, or why it does not answer."""
    name = gauge.name if gauge.name == gauge.axis else f"{gauge.name} ({gauge.axis})"
    age = age_text(gauge.age_s, later_s)
    if gauge.problem:
        since = "" if gauge.age_s is None else f", last answer {age}"
        return f"{name:3}NO READING{since}: {gauge.problem.removeprefix(f'gauge {gauge.name}: ')}"
    place, half = plunger_place(gauge), gauge.travel_mm / 2.0
    moved = gauge_deviation(gauge, zero_mm)
    reading = "-" if gauge.shown_mm is None else f"{gauge.shown_mm:+.4f}"
    deviation = f"{'':14}" if moved is None else f"{moved:+9.3f} mm  "
    stands = "" if place is None else f"  reads {reading} {gauge.unit}"
    old = "" if gauge.age_s is None or gauge.age_s + later_s <= OLD_S else f", {age}"
    return f"{name:3}{deviation}{travel_bar(place, half)}{stands}{old}"


def gauge_deviation(gauge: GaugeSnapshot, zero_mm: ThreeNumbers | None) -> float | None:
    """A gauge's reading along its base axis from the zero of the set, mm; None without either."""
    if gauge.shown_mm is None or zero_mm is None:
        return None
    return gauge.sign * gauge.shown_mm - zero_mm["xyz".index(gauge.axis)]


def gauge_figure(gauge: GaugeSnapshot, zero_mm: ThreeNumbers | None) -> str:
    """The deviation of a gauge from the zero of the set, without one its reading."""
    if gauge.problem or gauge.shown_mm is None:
        return "- - -"
    moved = gauge_deviation(gauge, zero_mm)
    return f"{gauge.shown_mm if moved is None else moved:+.3f}"


def plunger_place(gauge: GaugeSnapshot) -> float | None:
    """How far the plunger is pushed in beyond the middle of its travel, mm; None if not known."""
    if gauge.shown_mm is None or gauge.middle_mm is None:
        return None
    return gauge.shown_mm - gauge.middle_mm


def travel_bar(
    place_mm: float | None, half_mm: float, columns: int = BAR_COLUMNS, zone_mm: float = 0.0
) -> str:
    """A plunger in its travel: the middle is marked, the dot is where it stands.

    ``zone_mm`` to either side of the middle is drawn as where it should be.
    """
    middle = columns // 2
    wanted = round(min(1.0, zone_mm / half_mm) * middle)
    cells = ["━" if abs(cell - middle) <= wanted and wanted else "─" for cell in range(columns)]
    cells[middle] = "┼"
    if place_mm is not None:
        share = max(-1.0, min(1.0, place_mm / half_mm))
        cells[middle + round(share * middle)] = "●"
    return f"├{''.join(cells)}┤"


def age_text(age_s: float | None, later_s: float) -> str:
    """How long ago a device answered."""
    if age_s is None:
        return "never"
    age = age_s + later_s
    return f"{age:.1f} s ago" if age < 99.95 else "> 99 s ago"


def large_figures(
    live: LiveSnapshot | None, zero: ThreeNumbers | None
) -> list[tuple[str, str, str, Urgency]]:
    """Axis, figure, bar and urgency of each gauge, to be read from afar."""
    return [
        (
            one.axis,
            gauge_figure(one, zero),
            travel_bar(plunger_place(one), one.travel_mm / 2.0, WIDE_BAR),
            urgency_of(one.problem),
        )
        for one in (() if live is None else live.gauges)
    ]
