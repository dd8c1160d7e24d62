"""What records say of a robot: of a run that is over, or of a fit; in figures, pictures and HTML."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import hypot
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.errors import UsageError, did_you_mean
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array
from hexacell.measurements.columns import columns_of
from hexacell.measurements.records import MeasurementSet
from hexacell.results.result import IdentificationResult, RecordResidual
from hexacell.services.history.reported_run import ReportedRun, reported_run
from hexacell.services.offline import fit_measurements
from hexacell.text.report.statement import cards_of
from hexacell.text.svg_drawing import AFTER, BEFORE, INK, SMALLEST_MM, plain_ticks
from hexacell.verdict.assessment import Assessment
from hexacell.verdict.findings import findings
from procedures.run.keys import Phase

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAUGES = (("x", "o", BEFORE), ("y", "s", AFTER), ("z", "^", INK))
HELD_OUT = (("as found", "o", BEFORE, Phase.BEFORE), ("as left", "s", AFTER, Phase.AFTER))


@dataclass(frozen=True, repr=False, eq=False)
class Result:
    """What was identified from records, by the names of the parameters (``S1x``), and how good it is.

    Attributes:
        records: those that the geometry was identified from.
        verdict: ``pass``, ``fail``, ``conditional pass``, ...; None where nothing was judged.
        line: how the run ended, or what was found in the records.
        run: all that the folder of the run has; None for a fit.
        assessment: the fit with all checks of it; None for a run.
        residuals: what each record shows more than the geometry explains, mm along the gauges.
        names: of all parameters, in order.
    """

    records: MeasurementSet
    verdict: str | None
    line: str
    run: ReportedRun | None
    assessment: Assessment | None
    residuals: tuple[RecordResidual, ...]
    names: tuple[str, ...]
    _parameters: ParameterSet
    _identified: IdentificationResult | None

    def value(self, name: str) -> float:
        """A parameter, mm, or in its own unit; ``UsageError`` where there is none of that name."""
        [row], found = self._rows([name]), self._found
        return float(self._parameters.vector(found.geometry)[row])

    def sigma(self, name: str) -> float:
        """One standard deviation of it, 0 where the frames fix it; ``UsageError`` likewise."""
        [row], found = self._rows([name]), self._found
        return float(self._parameters.vector(found.sigma)[row])

    def covariance(self, names: Sequence[str] | None = None) -> Array:
        """The covariance (k, k) of some parameters, or of all; ``UsageError`` likewise."""
        rows = self._rows(self.names if names is None else names)
        return np.array(self._found.covariance)[np.ix_(rows, rows)]

    def plot_residuals(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the residuals along each gauge by the number of the record, on new axes by default."""
        axes = axes or _new_axes("record", "residual, mm")
        for place, (name, marker, colour) in enumerate(GAUGES):
            column = [one.mm[place] for one in self.residuals]
            axes.plot(range(1, len(column) + 1), column, marker, color=colour, markersize=3, label=name)
        axes.axhline(0.0, color=INK, linewidth=0.5)
        axes.legend(frameon=False, ncols=len(GAUGES))
        return axes

    def plot_errors(self, axes: "Axes | None" = None) -> "Axes":
        """Draw how far the ball was from its reference at each held-out pose, as found and as left."""
        held_out = {
            name: () if self.run is None else self.run.state.held_out(p) for name, *_, p in HELD_OUT
        }
        if not any(held_out.values()):
            raise UsageError(
                "no held-out pose was measured", action="Take the result of a calibration that is over"
            )
        axes = axes or _new_axes("held-out pose", "distance of the ball, mm")
        for name, marker, colour, _ in HELD_OUT:
            sizes = [max(hypot(*one), SMALLEST_MM) for one in held_out[name]]
            axes.semilogy(range(1, len(sizes) + 1), sizes, marker, color=colour, markersize=5, label=name)
        plain_ticks(axes.yaxis)
        axes.legend(frameon=False, ncols=len(HELD_OUT))
        return axes

    def _repr_html_(self) -> str:
        cards = "".join(f"<div>{one.svg}</div>" for one in (cards_of(self.run) if self.run else ()))
        told = f"<b>{escape(self.verdict or 'no verdict')}</b><p>{escape(self.line)}</p>"
        return f'{told}<div style="display:grid;grid-template-columns:22em 22em;gap:8px">{cards}</div>'

    @property
    def _found(self) -> IdentificationResult:
        if self._identified is None:
            raise UsageError(
                "no geometry was identified", action="Take the result of a calibration that is over"
            )
        return self._identified

    def _rows(self, names: Sequence[str]) -> list[int]:
        if unknown := [name for name in names if name not in self.names]:
            action = did_you_mean(unknown[0], self.names) or f"There are: {', '.join(self.names)}"
            raise UsageError(f"no parameter is called '{unknown[0]}'", action=action)
        return [self.names.index(name) for name in names]


def fit(cell: Cell, records: MeasurementSet) -> Result:
    """Identify the geometry from records alone; raises as :func:`fit_measurements`, and as good as that."""
    assessed, parameters = fit_measurements(cell, records), cell.settings.mechanism.parameters
    result = IdentificationResult.of(assessed.found, assessed.zeros)
    line, residuals = " ".join(findings(assessed)), RecordResidual.of_records(assessed.found)
    return Result(records, None, line, None, assessed, residuals, parameters.names, parameters, result)


def read_result(folder: Path | str) -> Result:
    """The result of a run by its folder; raises as :func:`reported_run`."""
    run = reported_run(Path(folder))
    state, parameters = run.state, run.settings.mechanism.parameters
    result, residuals = (one.result, one.residuals) if (one := state.identified) else (None, ())
    line = state.ended.line if state.ended else "the run is not over"
    known = (run, None, residuals, parameters.names, parameters, result)
    return Result(state.measurements(), state.verdict and state.verdict.value, line, *known)


def frame(of: MeasurementSet | Result) -> Any:  # noqa: ANN401 - pandas is no dependency
    """A ``pandas.DataFrame``: records as :func:`columns_of` has them, or parameters by name.

    Raises:
        UsageError: pandas is not installed.
    """
    try:
        import pandas as pd  # noqa: PLC0415 - optional
    except ImportError as error:
        raise UsageError(
            "a frame needs the package pandas", action="Install it, or use columns_of"
        ) from error
    if isinstance(of, MeasurementSet):
        return pd.DataFrame(columns_of(of))
    rows = {name: (of.value(name), of.sigma(name)) for name in of.names}
    return pd.DataFrame.from_dict(rows, orient="index", columns=["value", "sigma"])


def _new_axes(x: str, y: str) -> "Axes":
    import matplotlib.pyplot as plt  # noqa: PLC0415 - half a second that only figures need

    axes = plt.subplots(figsize=(7.0, 2.6), layout="constrained")[1]
    axes.set(xlabel=x, ylabel=y)
    return axes
