"""Text for what an identification found beside the geometry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hexacell.identification.terms.term import Finding
from hexacell.kinematics.corrections import NONE, CorrectionKind, Six
from hexacell.lengths import ShownUnit, unit_of
from hexacell.results.term_result import FoundTerms, TermResult
from hexacell.text.layout import wrapped
from hexacell.text.verdict import improvement_sentence

if TYPE_CHECKING:
    from procedures.run.state import RunState


def terms_text(results: Sequence[TermResult]) -> str:
    """A line for each term that was offered, and a table of those taken; empty where none was offered."""
    if not results:
        return ""
    sentences = " ".join(_sentence(result) for result in results)
    taken = [result for result in results if result.is_taken]
    return "\n".join([wrapped(f"Not geometry: {sentences}"), *_table(taken)])


def run_terms_text(state: RunState) -> str:
    """What a run found beside the geometry, what corrects it, and what that gained; empty for nothing."""
    found = found_sentence(state.found_terms)
    if not found or state.identified is None:
        return ""
    gain = improvement_sentence(state.identified.improvement, state.accuracy)
    return f"{found} {gain}".strip()


def found_sentence(found: FoundTerms) -> str:
    """The terms with their sizes, and what corrects each; empty for none."""
    said = [f"{_size(term)}, {_fate(term, found)}" for term in found.taken]
    said += [_sentence(term).rstrip(".") for term in found.terms if term.finding is Finding.NOT_DISTINCT]
    return f"Not geometry: {'; '.join(said)}." if said else ""


def _size(term: TermResult) -> str:
    unit = _unit(term)
    values, sigma = (_smallest_to_largest(sizes or NONE, unit) for sizes in (term.values, term.sigma))
    return f"{term.name} of {values} {unit.name} (one sigma {sigma})"


def _unit(term: TermResult) -> ShownUnit:
    return unit_of(*(term.values or ()), *(term.sigma or ()), unit=term.unit)


def _smallest_to_largest(numbers: Six, unit: ShownUnit) -> str:
    smallest, largest = unit.number(min(numbers)), unit.number(max(numbers))
    return smallest if smallest == largest else f"{smallest} to {largest}"


def _fate(term: TermResult, found: FoundTerms) -> str:
    if any(found.corrections.of(term.name)):
        return "corrected by the controller"
    is_backlash, can_be = term.name == CorrectionKind.BACKLASH, term.name in {*CorrectionKind}
    rest = "scatter at work" if is_backlash else "the geometry does as much as it can"
    return f"{'its config has no place for it' if can_be else 'no controller corrects it'}: {rest}"


def _sentence(result: TermResult) -> str:
    match result.finding:
        case Finding.TAKEN:
            return f"{result.name} is shown (evidence e^{result.log_factor:.0f}) and taken."
        case Finding.KNOWN:
            return f"{result.name} is {result.finding}."
        case Finding.NOT_DISTINCT:
            told_by = f"; what would tell: {result.told_by}" if result.told_by else ""
            both = f"{result.name} cannot be told apart from {result.rival}"
            return f"{both}; nothing is corrected of it{told_by}."
        case Finding.NOT_PREDICTED | Finding.FAULTS:
            return f"{result.name} is not taken: {result.finding}."
        case Finding.ONE_SIDE:
            return f"{result.name} is not needed: it {result.finding}."
        case Finding.NOT_SHOWN:
            return f"{result.name} is not shown."


def _table(taken: Sequence[TermResult]) -> list[str]:
    if not taken:
        return []
    lines = [f"  {'':20}" + "".join(f"{f'{leg}':>9}" for leg in range(1, len(taken[0].values or ()) + 1))]
    for result in taken:
        unit = _unit(result)
        rows = {f"{result.name}, {unit.name}": result.values, "  +- (one sigma)": result.sigma}
        for name, values in rows.items():
            lines.append(f"  {name:20}" + "".join(f"{unit.number(value):>9}" for value in values or ()))
    return lines
