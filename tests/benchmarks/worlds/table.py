"""What came of many trials: a line for each kind and size, and totals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from hexacell.verdict.decision import Verdict
from tests.benchmarks.worlds.kinds import KINDS
from tests.benchmarks.worlds.trials import Outcome

HEAD = (
    f"\n  {'kind':<38}{'size':>16}{'runs':>6}{'true mm':>9}{'most':>7}{'U mm':>7}"
    f"{'of sigma':>9}{'chi':>6}{'covered':>9}  verdicts; causes named"
)
SHORT = {
    Verdict.PASS: "pass",
    Verdict.CONDITIONAL_PASS: "cond. pass",
    Verdict.CONDITIONAL_FAIL: "cond. fail",
    Verdict.FAIL: "fail",
    Verdict.NOT_EVALUATED: "not evaluated",
    None: "no result",
}
SURELY = 1e-3
"""Probability with which a figure that is exactly on its target is found beyond it by chance."""


@dataclass(frozen=True, slots=True)
class Totals:
    """Shares over trials with a geometry that could be judged, and over all."""

    outcomes: Sequence[Outcome]

    @property
    def judged(self) -> list[Outcome]:
        """Those with a geometry."""
        return [one for one in self.outcomes if one.verdict is not None]

    @property
    def covered(self) -> float:
        """Share whose error is within U of the stated one."""
        return float(np.mean([one.is_covered for one in self.judged]))

    @property
    def passes(self) -> int:
        """How many passed."""
        return sum(one.verdict is Verdict.PASS for one in self.outcomes)

    @property
    def false_passes(self) -> int:
        """How many of them err by more than the limit."""
        return sum(one.is_false_pass for one in self.outcomes)

    @property
    def false_passes_with_u(self) -> int:
        """How many would pass falsely with a guard band of U alone."""
        return sum(one.is_false_pass_with_u for one in self.outcomes)

    @property
    def wrongly_named(self) -> int:
        """In how many a cause was named that is not there."""
        return sum(one.is_wrongly_named for one in self.outcomes)


def most_by_chance(share: float, count: int) -> int:
    """The largest number out of ``count`` that agrees with a share."""
    return int(binom.isf(SURELY, count, share))


def least_by_chance(share: float, count: int) -> int:
    """The smallest number out of ``count`` that agrees with a share."""
    return int(binom.ppf(SURELY, count, share))


def lines(outcomes: Iterable[Outcome]) -> list[str]:
    """A line for each kind and size, under ``HEAD``."""
    groups: dict[tuple[str, float], list[Outcome]] = {}
    for one in outcomes:
        groups.setdefault((one.trial.kind, one.trial.factor), []).append(one)
    return [_line(name, factor, Totals(group)) for (name, factor), group in groups.items()]


def _line(name: str, factor: float, totals: Totals) -> str:
    kind, judged = KINDS[name], totals.judged
    size = f"{factor * kind.usual:g} {kind.unit}"
    start = f"  {name:<38}{size:>16}{len(totals.outcomes):>6}"
    if not judged:
        return f"{start}  no result: {totals.outcomes[0].reason[:60]}"
    true = [one.true_mm for one in judged]
    over = np.median([one.true_mm / one.sigma_mm for one in judged])
    figures = (
        f"{np.median(true):>9.3f}{max(true):>7.3f}{np.median([one.u_mm for one in judged]):>7.3f}"
        f"{over:>9.1f}{np.median([one.ratio for one in judged]):>6.2f}{100 * totals.covered:>7.0f} %"
    )
    return f"{start}{figures}  {_verdicts(totals)}"


def _verdicts(totals: Totals) -> str:
    counts = Counter(SHORT[one.verdict] for one in totals.outcomes)
    said = ", ".join(f"{verdict} {count}" for verdict, count in counts.items())
    false = f", FALSE {totals.false_passes}" if totals.false_passes else ""
    named = Counter(name for one in totals.outcomes for name in one.named)
    causes = ", ".join(f"{name} {count}" for name, count in named.items())
    wrong = f" (WRONG {totals.wrongly_named})" if totals.wrongly_named else ""
    return f"{said}{false}{'; ' if causes else ''}{causes}{wrong}"
