"""Text for the length scale: whether it was checked, and what was found."""

from __future__ import annotations

from hexacell.presentation.layout import wrapped
from hexacell.reporting.length_result import LengthResult

NOT_CHECKED = "The length scale is that of the encoders; it was not checked."


def scale_lines(length: LengthResult | None) -> list[str]:
    """What is known of the length scale; none where a check contradicts itself, which its test says."""
    if length is None:
        return [NOT_CHECKED]
    if not length.is_consistent:
        return []
    checked = f"length scale: checked over {length.distance_mm:.3f} mm: {_encoders(length)}"
    return [checked, remedy(length)] if length.is_significant else [checked]


def _encoders(length: LengthResult) -> str:
    wrong_way = "long" if length.long_um_m >= 0.0 else "short"
    return f"encoders read {abs(length.long_um_m):.0f} +- {length.expanded_um_m:.0f} um/m {wrong_way}"


def remedy(length: LengthResult) -> str:
    """What to do about encoders that are not true to scale."""
    text = (
        f"No geometry corrects that: multiply the scale factor of all encoders by {length.factor:.6f}, at "
        "the drives and in [encoders] measuring_step_nm, and calibrate again."
    )
    return wrapped(f"  {text}", indent=2).strip()
