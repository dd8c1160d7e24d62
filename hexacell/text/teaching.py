"""Text for what must be taught anew because of a new geometry."""

from __future__ import annotations

from hexacell.results.written_geometry import TaskDisplacement

SMALLEST = 0.001
"""Nothing below is printed, mm or deg: it is that of the numbers in a config."""


def teaching_sentence(moved: TaskDisplacement) -> str:
    """What must be taught anew, and what not; nothing if all that was taught stays within the limits."""
    how_far = f"{_how_far(moved)} at the task poses"
    if moved.is_within_limits:
        return f"Nothing need be taught anew: taught points and frames move by at most {how_far}."
    return (
        f"Teach anew: Cartesian points, work and tool frames move by up to {how_far}. "
        "Points taught by joints stay."
    )


def teaching_line(moved: TaskDisplacement) -> str:
    """The same in a line of at most 80 columns."""
    if moved.is_within_limits:
        return f"Taught points and frames stay: they move by at most {_how_far(moved)}"
    return f"Teach Cartesian points and frames anew: they move by up to {_how_far(moved)}"


def _how_far(moved: TaskDisplacement) -> str:
    return f"{_figure(moved.position_mm)} mm, {_figure(moved.orientation_deg)} deg"


def _figure(value: float) -> str:
    decimals = 1 if value >= 10.0 else 2 if value >= 1.0 else 3
    return f"{max(value, SMALLEST):.{decimals}f}"
