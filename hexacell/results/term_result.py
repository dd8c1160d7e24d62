"""What an identification found beside the geometry, as data, and what of it a controller is to correct."""

from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hexacell.cell.fields import Frozen, JointNumbers
from hexacell.cell.model import CellSettings
from hexacell.identification.solver.result import Identification
from hexacell.identification.terms.term import Finding, ModelTerm
from hexacell.kinematics.corrections import NO_CORRECTIONS, NONE, CorrectionKind, Corrections
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import joints_of

ANY_WEIGHT_N = 100.0

SURE = 5.0
"""Standard deviations beyond which a coefficient is impossible, not off by chance."""

CHANGE = 0.1
"""Share by which a coefficient may have changed since it was identified, one standard deviation."""


class TermResult(Frozen):
    """A term that was offered.

    Attributes:
        finding: what the records say of it.
        log_factor: logarithm of the Bayes factor.
        predicted: by how much better points are predicted from the others with it, in the logarithm of the
            density of their records; None where that was not asked.
        rival: the term that it cannot be told from.
        told_by: the records that would tell, in words.
        unit: of its coefficients.
        values: coefficient of each joint or leg; None where it was not taken.
        sigma: one standard deviation of each.
    """

    name: str
    finding: Finding
    log_factor: float
    predicted: float | None = None
    rival: str = ""
    told_by: str = ""
    unit: str = ""
    values: JointNumbers | None = None
    sigma: JointNumbers | None = None

    @property
    def is_taken(self) -> bool:
        """Whether the identification has it."""
        return self.values is not None


@dataclass(frozen=True, slots=True)
class FoundTerms:
    """What was found beside the geometry, and what a controller corrects."""

    terms: tuple[TermResult, ...] = ()
    corrections: Corrections = NO_CORRECTIONS

    @property
    def taken(self) -> tuple[TermResult, ...]:
        """The terms that the identification has."""
        return tuple(term for term in self.terms if term.is_taken)


NOTHING_FOUND = FoundTerms()


def term_results(found: Identification) -> tuple[TermResult, ...]:
    """What was found of all terms that were offered."""
    taken: dict[str, dict[str, Any]] = {}
    if (terms := found.terms) is not None:
        for one in terms.terms:
            values, sigma = map(joints_of, terms.of(one.name))
            taken[one.name] = {"unit": one.unit, "values": values, "sigma": sigma}
    return tuple(TermResult(**asdict(tried), **taken.get(tried.name, {})) for tried in found.tried_terms)


def known_terms(offered: Iterable[ModelTerm], results: Iterable[TermResult]) -> tuple[ModelTerm, ...]:
    """The terms of some results as they are known from these; they may have changed by a tenth."""
    by_name = {term.name: term for term in offered}
    return tuple(
        replace(
            by_name[one.name],
            mean=np.array(one.values),
            sigma=np.hypot(one.sigma, CHANGE * np.abs(one.values)),
        )
        for one in results
        if one.values is not None and one.sigma is not None and one.name in by_name
    )


def impossible_terms(offered: Iterable[ModelTerm], results: Iterable[TermResult]) -> list[str]:
    """Coefficients that no machine has, in words, with what to check.

    Lost motion, clearance and compliance have no sign. A weight that pulls the other way than is stated has
    those by its forces negative.
    """
    by_name, found = {term.name: term for term in offered}, list[str]()
    for one in results:
        if one.values is None or one.sigma is None or one.name not in by_name:
            continue
        term, values, spread = by_name[one.name], np.array(one.values), SURE * np.array(one.sigma)
        stated = SURE * float(np.linalg.norm(term.spread, axis=1).max())
        check = "what the controller corrects already" if term.needs_directions else "where the weight acts"
        for rows, what in (
            (values + spread < 0.0, f"below zero; check {check}"),
            (values - spread > stated, f"far beyond what [model] states of it; check that and {check}"),
        ):
            if rows.any():
                legs = ", ".join(map(str, 1 + np.flatnonzero(rows)))
                found.append(
                    f"{one.name} of {one.values[int(rows.argmax())]:.3g} {one.unit} (leg {legs}), {what}"
                )
    return found


def corrections_for(
    results: Iterable[TermResult],
    settings: CellSettings,
    holds: Collection[str],
    before: Corrections = NO_CORRECTIONS,
) -> tuple[Corrections | None, dict[str, Array]]:
    """What a controller is to correct of the terms that were taken, and the coefficients that are left.

    Weight and centre are the cell file's. Of play only the sides matter on which the joints lie: they are
    those of any weight. No leg gets longer when it is pushed: a compliance that noise makes negative is
    zero.

    Args:
        results: of all terms.
        settings: of the cell.
        holds: the kinds of corrections that the controller's config has a place for.
        before: what it corrects now, and goes on to of kinds that are not in the results.

    Returns:
        None for corrections that stay as they are.
    """
    values = {result.name: result.values for result in results if result.values is not None}
    able = [kind for kind in CorrectionKind if kind in values and kind in holds]
    left = {name: np.array(value) for name, value in values.items() if name not in able}
    if not able:
        return None, left
    stated = settings.uncertainty
    wanted = Corrections(
        backlash=values.get("backlash", NONE),
        play_mm=values.get("play", NONE),
        compliance_um_n=joints_of(np.maximum(values.get("compliance", NONE), 0.0)),
        weight_n=stated.own_weight_n or ANY_WEIGHT_N,
        weight_direction=stated.own_weight_direction,
        weight_centre_mm=stated.own_weight_centre_mm,
    )
    return before.taking(wanted, able), left
