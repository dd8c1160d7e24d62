"""Text for what an identification found beside the geometry."""

from collections.abc import Sequence

from hexacell.identification.terms.finding import Finding
from hexacell.results.term_result import TermResult
from hexacell.text.layout import wrapped


def terms_text(results: Sequence[TermResult]) -> str:
    """A line for each term that was offered, and a table of those taken; empty where none was offered."""
    if not results:
        return ""
    sentences = " ".join(_sentence(result) for result in results)
    taken = [result for result in results if result.is_taken]
    return "\n".join([wrapped(f"Not geometry: {sentences}"), *_table(taken)])


def _sentence(result: TermResult) -> str:
    match result.finding:
        case Finding.TAKEN:
            return f"{result.name} is shown (evidence e^{result.log_factor:.0f}) and taken."
        case Finding.NOT_DISTINCT:
            return f"{result.name} cannot be told apart from {result.rival}; nothing is corrected of it."
        case Finding.NOT_PREDICTED | Finding.FAULTS:
            return f"{result.name} is not taken: {result.finding}."
        case Finding.ONE_SIDE:
            return f"{result.name} is not needed: it {result.finding}."
        case Finding.NOT_SHOWN:
            return f"{result.name} is not shown."


def _table(taken: Sequence[TermResult]) -> list[str]:
    if not taken:
        return []
    lines = [f"  {'':20}" + "".join(f"{f'{leg}':>9}" for leg in range(1, 7))]
    for result in taken:
        rows = {f"{result.name}, {result.unit}": result.values, "  +- (one sigma)": result.sigma}
        for name, values in rows.items():
            lines.append(f"  {name:20}" + "".join(f"{value:9.3f}" for value in values or ()))
    return lines
