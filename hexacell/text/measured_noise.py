"""Text for the noise that a run measured at its start: what it is, what is wrong, and what to do."""

from collections.abc import Iterator, Sequence

from hexacell.kinematics.parameters import JointUnit
from hexacell.lengths import shown, unit_of
from hexacell.noise.approach_scatter import RepeatedApproaches, ScatterSource
from hexacell.noise.measured_noise import AveragingForecast, InstrumentNoise, MeasuredNoise
from hexacell.noise.noise_assessment import worthwhile_windows
from hexacell.noise.reversal import Reversal
from hexacell.noise.worsening import Worsening
from hexacell.text.layout import duration, wrapped

THOUSAND = 1e3
WHOLE = 9.95
"""Size from which figures are whole micrometres or millidegrees."""
NOTEWORTHY_DRIFT = 1.0
"""Smallest drift within seconds that is mentioned, in units of the noise of a record."""


def measured_noise_text(measured: MeasuredNoise, *, with_averaging: bool = False) -> str:
    """What was measured, what is wrong and, if asked for, what means of more readings gain."""
    lines = [*_summary(measured), *_warnings(measured)]
    lines += _averaging(measured) if with_averaging else ()
    return "\n".join(wrapped(line, indent=2) for line in lines)


def measured_noise_sentences(measured: MeasuredNoise) -> tuple[str, ...]:
    """What was measured and what is wrong, as sentences of a page."""
    lines = (" ".join(line.split()) for line in [*_summary(measured), *_warnings(measured)])
    return tuple(f"{line[:1].upper()}{line[1:].removesuffix('.')}." for line in lines)


def reversal_sentence(found: Reversal) -> str:
    """What repeated visits of the references showed, with the terms of ISO 230-2."""
    repeatability = f"repeatability of the ball {shown(found.repeatability_mm)}"
    if found.joints is None or found.sigma is None:
        return f"every visit from one side: {repeatability}, reversal not measured"
    unit = unit_of(*found.joints, *found.sigma, unit=found.unit)
    smallest, largest = (unit.number(limit(found.joints)) for limit in (min, max))
    ball = unit_of(found.ball_mm, found.ball_sigma_mm)
    return (
        f"reversal of the joints {smallest} to {largest} +- {unit.length(max(found.sigma))}, of the ball "
        f"{ball.number(found.ball_mm)} +- {ball.length(found.ball_sigma_mm)}; bidirectional {repeatability}"
    )


def worsening_sentence(found: Worsening) -> str:
    """That the machine got worse, with both numbers, and what to look for."""
    unit = unit_of(found.first_mm, found.later_mm)
    beside, look = "between encoders and ball", "a screw, a clamp, a guide or a joint that works loose"
    if found.is_seen:
        beside, look = "seen by the encoders", "a drive that warms up, friction, a servo loop or a brake"
    return (
        f"the machine got worse during the run: at the ends of the last {found.sets} points the ball came "
        f"back to within {unit.length(found.later_mm)} (one sigma of an axis, {beside}), to within "
        f"{unit.length(found.first_mm)} before. Look for {look}, and calibrate again then"
    )


def _summary(measured: MeasuredNoise) -> Iterator[str]:
    yield f"noise                    {_of_each_kind(measured, 'record')} a record"
    if measured.gauges[0].reading is not None:
        yield f"  readings at rest: {_of_each_kind(measured, 'reading')}"
    approaches = measured.approaches
    if approaches is not None and approaches.source is None:
        yield (
            f"  {approaches.visits} visits of one pose agree with what is stated for a record: they "
            f"scatter {approaches.ratio:.1f} times as much"
        )
    if approaches is not None and approaches.stops:
        size = f"{_number(approaches.stops)} {approaches.stop_unit.thousandth}"
        yield (
            f"  each joint stops {size} (one sigma) beside its command, as its encoder shows: the ball by "
            f"{shown(approaches.ball_mm)}. The records know it; the robot at work errs by it, and no "
            "geometry corrects that"
        )


def _of_each_kind(measured: MeasuredNoise, figure: str) -> str:
    """A figure of gauges and encoders, um; of several alike the range."""
    gauges, encoders = _range(measured.gauges, figure), _range(measured.encoders, figure)
    unit = measured.encoders[0].unit
    of_gauges = "" if unit is JointUnit.MM else f" {JointUnit.MM.thousandth}"
    return f"gauges {gauges}{of_gauges}, encoders {encoders} {unit.thousandth}"


def _range(instruments: Sequence[InstrumentNoise], figure: str) -> str:
    values = sorted(getattr(one, figure) for one in instruments)
    first, last = _number(values[0]), _number(values[-1])
    return first if first == last else f"{first} to {last}"


def _number(size: float) -> str:
    """A size in thousandths of its unit, to two digits where it is below 10."""
    shown = THOUSAND * size
    return f"{shown:.2g}" if shown < WHOLE else f"{shown:.0f}"


def _warnings(measured: MeasuredNoise) -> Iterator[str]:
    for one in (*measured.gauges, *measured.encoders):
        yield from _of_instrument(one)
    if measured.approaches is not None and measured.approaches.source is not None:
        yield _of_approaches(measured.approaches, measured.approaches.source)


def _of_instrument(one: InstrumentNoise) -> Iterator[str]:
    is_gauge, unit = one.name.startswith("gauge"), one.unit.thousandth
    if one.is_noisier and one.reading is not None:
        look = "a loose clamp, vibration or its cable" if is_gauge else "its cable, its head and vibration"
        yield (
            f"  {one.name}: its readings scatter by {_number(one.reading)} {unit} without moving, more "
            f"than the {_number(one.stated)} {unit} stated for a record. The run counts with "
            f"{_number(one.record)} {unit}. Look at {look}; if that is how it is, state it in [noise]"
        )
    if abs(one.drift) > NOTEWORTHY_DRIFT * one.stated:
        look = "let it warm up, and look whether its stand creeps" if is_gauge else "see whether it slides"
        yield f"  {one.name}: it drifted by {THOUSAND * one.drift:+.0f} {unit} within the series: {look}"
    if one.outliers:
        what = "a reading was" if one.outliers == 1 else f"{one.outliers} readings were"
        yield f"  {one.name}: {what} false, and left out. Look at its cable and contacts"


def _of_approaches(found: RepeatedApproaches, source: ScatterSource) -> str:
    size = f"{_number(found.excess)} {found.unit.thousandth}"
    if source is ScatterSource.JOINTS:
        what = f"the joints stop {size} beside what their encoders show"
        look = "Look for play in guides and joints, and for friction"
    elif source is ScatterSource.ENCODERS or source.startswith("encoder"):
        what = f"{source}: {size} beside where the joints are, though the ball is at its place"
        look = "Look at reading heads, scales and cables"
    else:
        what = f"{source} shows {size} more or less at the same place"
        look = "Look at its plunger, its plate and its clamp"
    return (
        f"  {found.visits} visits of one pose scatter {found.ratio:.1f} times as much as the stated noise "
        f"explains: {what}. The run counts with that. {look}"
    )


def _averaging(measured: MeasuredNoise) -> Iterator[str]:
    """What more readings a record would gain, or gain."""
    if not measured.forecasts:
        return
    first, chosen = measured.forecasts[0], measured.windows
    part = measured.encoders_part_mm
    unit = unit_of(first.error_mm)
    of_encoders = "" if part is None else f"the encoders contribute {unit.number(part)} of "
    yield f"  {of_encoders}the {unit.length(first.error_mm)} expected at the task in the end (one sigma)"
    by_windows = {one.windows: one for one in measured.forecasts}
    possible = worthwhile_windows(measured.forecasts, max(by_windows))
    if chosen > 1:
        gain = _gain(by_windows[chosen])
        yield (
            f"  a record is the mean of {chosen} windows of readings, which gives {gain}; "
            "averaged_windows = 1 in [noise] does without"
        )
    if possible > chosen:
        yield (
            f"  {possible} windows of readings a record would give {_gain(by_windows[possible])}: "
            f"averaged_windows = {possible} in [noise] allows it"
        )


def averaging_lines(
    forecasts: Sequence[AveragingForecast], encoders_part_mm: float | None
) -> Iterator[str]:
    """Before a run: what the encoders contribute, and what means of more readings may gain."""
    if len(forecasts) < 2 or encoders_part_mm is None:
        return
    first, fourfold = forecasts[0], forecasts[min(2, len(forecasts) - 1)]
    unit = unit_of(first.error_mm)
    yield (
        f"The noise of the encoders makes about {unit.number(encoders_part_mm)} of "
        f"{unit.length(first.error_mm)} (one "
        f"sigma). As far as noise differs from reading to reading, which a run measures, "
        f"{fourfold.windows} windows of readings a record give {_gain(fourfold)}."
    )


def _gain(one: AveragingForecast) -> str:
    return f"{shown(one.error_mm)} for {duration(one.minutes)} more"
