"""The past runs of a cell: a table, and the course of the error."""

from collections.abc import Sequence

from hexacell.services.history.run_index import PastRun
from hexacell.text.history import standing
from hexacell.text.layout import error_with_u, verdict_word
from hexacell.text.screens.banner import verdict_urgency
from hexacell.text.screens.run_picture import MODES
from hexacell.text.screens.views import PlotView, Row, Series

NOTHING_ASKED = (
    "v compares the chosen run with the one before it, o shows the drift of each parameter over all runs.",
)


def run_rows(runs: Sequence[PastRun]) -> tuple[Row, ...]:
    """A row for each run, in their order."""
    return tuple(Row(run.name, _cells(run), verdict_urgency(run.summary.verdict)) for run in runs)


def _cells(run: PastRun) -> tuple[str, ...]:
    was = run.summary
    what, error = MODES.get(was.mode, was.mode or "-"), error_with_u(was.accuracy).replace("+-", "±")
    return run.name[:19], what, verdict_word(was.verdict), error, standing(run)


def trend_plot(runs: Sequence[PastRun]) -> PlotView:
    """The largest error at the task poses by each run, the earliest first, and the latest limit."""
    judged = [one.summary.position for one in reversed(runs) if one.summary.position is not None]
    found = tuple((float(number), max(one.value, 1e-4)) for number, one in enumerate(judged, start=1))
    pairs = zip(found, judged, strict=True)
    with_u = tuple((x, y + one.expanded) for (x, y), one in pairs if one.expanded is not None)
    limit = judged[-1].limit if judged else None
    return PlotView(
        title="Error at the task poses, mm",
        x_label="run",
        series=(Series("error", "o", found), Series("error with U", "+", with_u)),
        level=limit,
        level_name="" if limit is None else f"limit {limit:g} mm",
        is_logarithmic=True,
        note="No run has a verdict yet.",
    )
