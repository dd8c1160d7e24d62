"""Text for old runs: identified again, or deleted."""

from __future__ import annotations

from hexacell.results.result import IdentificationResult
from hexacell.results.run_comparison import ParameterDifference
from hexacell.services.history.refit import RefittedRun
from hexacell.services.history.retention import Retention
from hexacell.text.layout import wrapped


def refit_text(found: RefittedRun) -> str:
    """How far a run's result is from what its records give today, then every free parameter."""
    then, today, most = found.then, found.today, found.largest
    sentence = (
        f"{found.folder.path.name}, identified again with the cell file and the program of today: "
        f"{_fit_words(then)} then, {_fit_words(today)} now; most differs {most.name}, "
        f"by {most.change:+.4f} {most.unit} ({abs(most.change) / most.sigma:.1f} sigma)."
    )
    head = f"{'':5}{'then':>15}{'today':>15}{'difference':>11}{'sigma':>9}"
    return "\n".join([wrapped(sentence), head, *map(_refit_line, found.parameters)])


def _fit_words(result: IdentificationResult) -> str:
    return f"chi-square {result.chi2:.0f} of {result.dof} from {result.records} records"


def _refit_line(one: ParameterDifference) -> str:
    return f"{one.name:5}{one.before:15.4f}{one.after:15.4f}{one.change:+11.4f}{one.sigma:9.4f}"


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
