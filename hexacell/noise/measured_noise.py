"""The noise that a run has measured at its start, and what follows from it for everything after."""

from hexacell.cell.fields import Frozen, Point
from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import STOPS, repeatability_key
from hexacell.kinematics.parameters import JointUnit
from hexacell.noise.approach_scatter import RepeatedApproaches, ScatterSource


class InstrumentNoise(Frozen):
    """The noise of one gauge or encoder, one standard deviation, in its unit.

    Attributes:
        reading: of a single reading at standstill, with its degrees of freedom; None without a series.
        drift: change over the series, zero unless significant.
        correlation: of successive readings, zero unless significant.
        stated: of a record, by the cell file.
        is_noisier: whether a record is noisier by its readings alone than stated.
        record: of a record, as the run uses it from now on.
    """

    name: str
    unit: JointUnit = JointUnit.MM
    reading: float | None = None
    degrees_of_freedom: int = 0
    drift: float = 0.0
    outliers: int = 0
    correlation: float = 0.0
    stated: float
    is_noisier: bool = False
    record: float


class AveragingForecast(Frozen):
    """Records that are means of some settled windows.

    Attributes:
        error_mm: predicted at the worst task pose once all is measured, one standard deviation.
    """

    windows: int
    error_mm: float
    minutes: float


class MeasuredNoise(Frozen):
    """The noise of the gauges x, y and z and of the encoders of legs 1 to 6, as measured.

    Attributes:
        approaches: None where the reference was not visited again.
        windows: settled windows that a record is the mean of from now on.
        forecasts: for different numbers of windows; empty where no accuracy is predicted.
        encoders_part_mm: what the encoders contribute to the first of these errors.
    """

    gauges: tuple[InstrumentNoise, InstrumentNoise, InstrumentNoise]
    encoders: tuple[InstrumentNoise, ...]
    approaches: RepeatedApproaches | None = None
    windows: int = 1
    forecasts: tuple[AveragingForecast, ...] = ()
    encoders_part_mm: float | None = None


def with_measured_noise(settings: CellSettings, measured: MeasuredNoise) -> CellSettings:
    """The settings of a cell with what was measured in the place of what they state."""
    gauges: Point = tuple(one.record for one in measured.gauges)  # type: ignore[assignment]
    encoders: tuple[float, ...] = tuple(one.record for one in measured.encoders)
    stated, approaches = settings.noise, measured.approaches
    stops = stated.stops
    if approaches is not None:  # as measured, unless more is stated and holds
        stops = approaches.stops if stated.figures == "measured" else max(stops, approaches.stops)
    noise = stated.model_copy(update={"gauges_mm": gauges, "encoders": encoders, "stops": stops})
    update = {"noise": noise, "uncertainty": _stated_effects(settings, measured)}
    return with_windows(settings, measured.windows).model_copy(update=update)


def with_windows(settings: CellSettings, windows: int) -> CellSettings:
    """The settings of a cell whose records take the time of some windows."""
    timing = settings.timing.model_copy(update={"window_s": windows * settings.timing.window_s})
    return settings.model_copy(update={"timing": timing})


def averaging_seconds(settings: CellSettings, windows: int) -> float:
    """How much longer a record takes that is the mean of some windows."""
    return (windows - 1) * settings.timing.window_s


def _stated_effects(settings: CellSettings, measured: MeasuredNoise) -> object:
    """The section of systematic effects; stops that were measured are in the noise of the records."""
    stated, approaches = settings.uncertainty, measured.approaches
    if approaches is None:
        return stated
    visits = f"{approaches.visits} visits of the first reference"
    keys, changes = [STOPS] if approaches.stops else [], dict[str, object]()
    if approaches.source is ScatterSource.JOINTS:
        key = repeatability_key(approaches.unit)
        keys.append(key)
        changes = {key: 1e3 * approaches.excess, "stop_repeatability_acts": "at work"}
    sources = stated.sources | dict.fromkeys(keys, visits)
    return stated.model_copy(update=changes | {"sources": sources})
