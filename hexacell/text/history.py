"""Text for the runs of a cell: a list, two of them compared, the drift over all, old ones deleted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hexacell.lengths import unit_of
from hexacell.services.history.run_index import PastRun
from hexacell.text.layout import change_with_sigma, error_with_u, verdict_word, wrapped

if TYPE_CHECKING:
    from hexacell.results.run_comparison import ParameterTrend, RunComparison
    from hexacell.runs.run_folder import RunFolder
    from hexacell.services.history.drift_history import DriftHistory, FoundChange
    from hexacell.services.history.past_runs import Retention

NO_RUNS = "This cell has no runs yet."
NO_DRIFT = "A drift needs three calibrations of the cell."
TREND_DAYS = 30.0
LONGEST_RUN_NAME = 22


def history_text(runs: Sequence[PastRun]) -> str:
    """A line a run of at most 80 columns, in their order; the error is that at the task poses, +- U."""
    if not runs:
        return NO_RUNS
    head = _columns("run", "mode", "verdict", "error, mm", "")
    return "\n".join([head, *map(history_line, runs)])


def history_line(run: PastRun) -> str:
    """One run: its name, mode, verdict, error and what became of it."""
    was, name = run.summary, run.name[:LONGEST_RUN_NAME]
    verdict, error = verdict_word(was.verdict), error_with_u(was.accuracy)
    return _columns(name, was.mode or "-", verdict, error, standing(run))


def standing(run: PastRun) -> str:
    """What became of a run, in a few words."""
    if not run.summary.mode:
        return "unreadable"
    if not run.summary.has_begun:
        return "not begun"
    if run.is_in_controller:
        return "in controller" if run.summary.is_over else "unverified!"
    if run.summary.has_proposal:
        return "proposal"
    if not run.summary.is_over:
        return "not over"
    return "replaced" if run.summary.has_written else ""


def comparison_text(before: RunFolder, after: RunFolder, compared: RunComparison) -> str:
    """The verdict on the change in words, then every free parameter."""
    from hexacell.text.parameters import parameter_table, rows_of_changes  # noqa: PLC0415 - not for `status`

    return "\n".join(
        [
            wrapped(f"{before.name} -> {after.name}: {comparison_sentence(compared)}"),
            *parameter_table(rows_of_changes(compared.parameters), "before", "after"),
            wrapped(
                f"In the frame convention {compared.frame}: where a point that it fixes moved, others "
                "show it. Sigma is the noise of both runs."
            ),
        ]
    )


def comparison_sentence(compared: RunComparison) -> str:
    """Whether the machine changed, and what changed most."""
    if not compared.is_changed:
        return "nothing changed by more than the noise of the records explains."
    ratio = f"the machine changed: {compared.test.ratio:.1f} times what the noise explains"
    if not compared.significant:
        return f"{ratio}, by several parameters together."
    most = compared.significant[0]
    return f"{ratio}; most of all {most.name}, by {change_with_sigma(most)}."


def drift_text(found: Sequence[ParameterTrend]) -> str:
    """A line a parameter: first and last value, change in 30 days, and whether it drifts."""
    if not found:
        return NO_DRIFT
    walking = [one.name for one in found if one.is_walking]
    verdict = f"Drifting: {', '.join(walking)}." if walking else "No parameter drifts."
    said = wrapped(f"{verdict} In mm or deg; sigma is one standard deviation.")
    lines = [said, f"{'':5}{'first':>15}{'last':>15}{'in 30 days':>14}{'sigma':>10}"]
    for one in found:
        change, sigma = TREND_DAYS * one.per_day, TREND_DAYS * one.sigma_per_day
        mark = "  drifts" if one.is_walking else ""
        values = f"{one.values[0]:15.4f}{one.values[-1]:15.4f}"
        lines.append(f"{one.name:5}{values}{change:+14.4f}{sigma:10.4f}{mark}")
    return "\n".join(lines)


def _columns(name: str, mode: str, verdict: str, error: str, what: str) -> str:
    return f"{name:23}{mode:9}{verdict:17}{error:17}{what}".rstrip()


def retention_text(found: Retention, *, is_deleted: bool) -> str:
    """Which old runs go, and why the others stay."""
    verb = "were deleted" if is_deleted else "may be deleted"
    counted = f"{len(found.leaving)} of {len(found.leaving) + len(found.kept)} runs"
    lines = [f"{counted} from before {found.before:%Y-%m-%d} {verb}."]
    lines += [f"  {run.name}" for run in found.leaving]
    lines += [f"  {run.name} stays: {reason}" for run, reason in found.kept]
    if found.leaving and not is_deleted:
        lines.append("Add --delete to delete them; what they say of drift goes with them.")
    return "\n".join(lines)


def watch_text(found: DriftHistory) -> str:
    """What changed and when, and how near the largest sum is to an alarm; empty without runs."""
    if not found.runs:
        return ""
    lines = [wrapped(change_sentence(one), indent=2) for one in found.changes]
    name, share = max(found.shares, key=lambda one: one[1])
    since = "since then " if found.changes else ""
    first, last = (f"{at:%Y-%m-%d}" for at in (found.runs[0], found.runs[-1]))
    runs = f"{len(found.runs)} runs from {first} to {last}" if len(found.runs) > 1 else f"1 run of {first}"
    quiet = "" if found.changes else "no leg has moved: "
    rest = f"{runs}: {quiet}{since}the largest sum of innovations is {share:.0%} of its limit ({name})."
    shown = [one for one in found.celsius if one is not None]
    warmth = [f"Their thermometers showed {min(shown):.1f} to {max(shown):.1f} deg C."] if shown else []
    return "\n".join([*lines, wrapped(rest, indent=2), *warmth])


def legs_text(found: FoundChange) -> str:
    """The leg that changed, or those of which one did."""
    return " or ".join(map(str, found.possible_legs))


def change_sentence(found: FoundChange) -> str:
    """A change that was found: which leg, by how much, when, and whether others changed as well."""
    unit = unit_of(found.change, found.sigma, unit=found.parameter.kind.unit.value)
    others = " and ".join(str(leg) for leg in found.other_legs)
    size = f"{unit.number(abs(found.change))} +- {unit.length(found.sigma)}"
    rest = f"legs {others} moved as well" if len(found.other_legs) > 1 else f"leg {others} moved as well"
    beside = ((name, unit_of(by, unit=of).length(by)) for name, by, of in found.or_parameters)
    also = "".join(f" or {name} by {by}" for name, by in beside)
    last = f"noticed {found.moved_again} more times, last {found.last_noticed:%Y-%m-%d}"
    again = f" It has moved on since; {last}." if found.moved_again else ""
    return (
        f"leg {legs_text(found)} moved {size} (as {found.parameter.name} by "
        f"{unit.number(found.change, '+')}{also}) "
        f"between {found.after:%Y-%m-%d %H:%M} and {found.before:%Y-%m-%d %H:%M}"
        f"; {rest if others else 'the others did not'}. "
        f"Noticed {found.noticed:%Y-%m-%d}.{again}"
    )
