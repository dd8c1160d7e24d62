"""The predicted accuracy, before and after."""

from __future__ import annotations

from hexacell.assessment import Assessment
from hexacell.identification.accuracy import PoseErrors


def accuracy_table(assessed: Assessment) -> str:
    """Errors at the task poses with the geometry the controller has now, and with the identified one."""
    accuracy = assessed.accuracy
    if accuracy is None:
        return ""
    what = "task poses" if assessed.task_named else "poses across the workspace"
    title = f"Predicted error at {len(accuracy.poses)} {what}"
    return "\n".join(
        [
            f"{title:44}{'position, mm':>17}{'angle, deg':>18}",
            f"{'':44}{'rms':>8}{'largest':>9}{'rms':>9}{'largest':>9}",
            _line("geometry the controller has now", accuracy.before),
            _line("identified geometry (one sigma)", accuracy.after),
        ]
    )


def _line(name: str, errors: PoseErrors) -> str:
    return (
        f"  {name:42}{errors.position_rms_mm:8.3f}{errors.position_largest_mm:9.3f}"
        f"{errors.orientation_rms_deg:9.4f}{errors.orientation_largest_deg:9.4f}"
    )
