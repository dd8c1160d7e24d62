"""Text for the length scale: whether it was checked, and what was found."""

from __future__ import annotations

from hexacell.results.length_result import LengthResult, encoders_read
from hexacell.text.layout import wrapped
from hexacell.verdict.length_statement import LengthStatement

NAMED_SOURCES = 4
"""So many of the sources of uncertainty are printed, the largest."""


def not_checked(scale_of: str = "encoders") -> str:
    """Where the length scale comes from, if nobody checked it."""
    if scale_of == "encoders":
        return "The length scale is that of the encoders; it was not checked."
    return "The length scale is that of the drawing, within its tolerances, which U contains."


def scale_lines(length: LengthResult | None, scale_of: str = "encoders") -> list[str]:
    """What is known of the length scale; none where a check contradicts itself, which its test says."""
    if length is None:
        return [not_checked(scale_of)]
    if not length.is_consistent:
        return []
    checked = f"length scale: checked over {length.distance_mm:.3f} mm: {encoders_read(length)}"
    return [checked, remedy(length)] if length.is_significant else [checked]


def earlier_scale_line(length: LengthResult | None, scale_of: str = "encoders") -> str:
    """What a check knows of the length scale, by the run of the result that it started from."""
    if length is None or not length.is_consistent:
        return not_checked(scale_of)
    return f"length scale: as checked in that run: {encoders_read(length)}"


def length_text(stated: LengthStatement) -> str:
    """A few lines: the verdict, the scale, what it does at the task, and what U consists of."""
    result, error = stated.result, stated.error
    lines = [f"verdict: {stated.verdict}"]
    if not result.is_consistent:
        return "\n".join([*lines, wrapped(f"  the length check says nothing: {result.reason}", indent=2)])
    lines += [f"  {line}" for line in scale_lines(result)]
    if error is not None:
        size = f"{error.value:.3f} mm, U {error.expanded:.3f} ({error.rule})"
        lines.append(f"  position error by that at the task poses: {size}")
    largest = sorted(result.sources, key=lambda source: -source.um_m)[:NAMED_SOURCES]
    named = ", ".join(f"{source.name} {source.um_m:.1f}" for source in largest)
    return "\n".join([*lines, wrapped(f"  uncertainty, um/m, 1 sigma: {named}", indent=2)])


def remedy(length: LengthResult) -> str:
    """What to do about encoders that are not true to scale."""
    text = (
        f"No geometry corrects that: multiply the scale factor of all encoders by {length.factor:.6f}, at "
        "the drives and in [encoders] measuring_step_nm, and calibrate again."
    )
    return wrapped(f"  {text}", indent=2).strip()
