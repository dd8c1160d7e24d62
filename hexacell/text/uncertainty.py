"""Text for the uncertainty budget: a table of its lines, and what no record can show."""

from __future__ import annotations

from hexacell.text.layout import wrapped
from hexacell.uncertainty.budget import BudgetLine, UncertaintyBudget

SMALLEST_MM = 0.0005
"""Lines below are zero in the table, and left out."""


def budget_table(budget: UncertaintyBudget | None) -> str:
    """One line for the noise and each effect that matters, their sum, and what the records cannot show."""
    if budget is None:
        return ""
    lines = [line for line in budget.lines if max(_figures(line)) >= SMALLEST_MM]
    title = "Uncertainty at the worst task pose, mm"
    noise = "noise, and all that is not identified" if budget.has_held else "noise of the readings"
    return "\n".join(
        [
            f"{title:44}{'size':>12}{'result':>8}{'direct':>8}{'both':>8}",
            f"  {noise:42}{'':12}{budget.noise_mm:8.3f}{'':8}{budget.noise_mm:8.3f}",
            *map(_row, lines),
            f"  {'standard uncertainty (root of the squares)':70}{budget.standard_mm:8.3f}",
            f"  {_expanded(budget):70}{budget.expanded_mm:8.3f}",
            *_unseen(budget),
        ]
    )


def _row(line: BudgetLine) -> str:
    effect = line.effect
    size = f"{effect.size:.3g} {effect.unit}"
    through, direct, combined = _figures(line)
    return f"  {effect.name:42}{size:>12}{_shown(through)}{_shown(direct)}{combined:8.3f}"


def _figures(line: BudgetLine) -> tuple[float, float, float]:
    return line.through_mm, line.direct_mm, line.combined_mm


def _shown(length_mm: float) -> str:
    return f"{length_mm:8.3f}" if length_mm else f"{'-':>8}"


def _expanded(budget: UncertaintyBudget) -> str:
    return f"U, 95 %, of the largest error of all poses (angle: {budget.expanded_deg:.3f} deg)"


def _by_one_unit(line: BudgetLine) -> str:
    length_mm = line.per_unit_mm
    shown = f"{length_mm:.2g} mm" if length_mm >= 0.1 else f"{1e3 * length_mm:.2g} um"
    return f"{shown} by 1 {line.effect.unit}"


def _unseen(budget: UncertaintyBudget) -> list[str]:
    """The sentence on what is not checked."""
    named = [f"{line.effect.name} ({_by_one_unit(line)})" for line in budget.unseen]
    return [wrapped(f"Not checked, as no record shows it: {', '.join(named)}.", indent=2)] if named else []
