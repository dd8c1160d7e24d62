"""Text for a plan of which poses may be taken out: its poses, and what leaving some out costs."""

from __future__ import annotations

from collections.abc import Iterator

from hexacell.campaign.removed_poses import NOTHING_REMOVED, RemovedPoses
from hexacell.dry_run.checks import CheckTrial, QuickTrial
from hexacell.services.offline import PlanTrial
from hexacell.services.preflight.plan_draft import ModeTrial, PlanDraft, PlanPreview
from hexacell.text.layout import duration
from hexacell.text.planning import check_trial_text, plan_trial_lines, quick_trial_text

REQUEST = (
    "Type what to take out, or to put back: a point (3), a pose (3.2), one that is out (r1).\n"
    "l lists the poses, Enter begins the run, q begins none: "
)
OUT = "OUT"
"""Before what is left out."""


def mode_trial_lines(trial: ModeTrial) -> Iterator[str]:
    """What a run is expected to give."""
    match trial:
        case PlanTrial():
            yield from plan_trial_lines(trial)
        case CheckTrial():
            yield check_trial_text(trial)
        case QuickTrial():
            yield quick_trial_text(trial)


def plan_rows(draft: PlanDraft) -> tuple[tuple[str, str], ...]:
    """A name and a line for each point, below it for each of its poses, what is left out last."""
    return tuple(row for point in draft.points for row in _rows_at(draft, point))


def _rows_at(draft: PlanDraft, point: int) -> list[tuple[str, str]]:
    name = str(point)
    position = draft.settings.identification.points[point - 1]
    where = f"point {name}, x {position[0]:.1f}  y {position[1]:.1f}  z {position[2]:.1f}"
    if point in draft.removed.points:
        return [(name, f"{OUT}  {where}: not measured")]
    poses = draft.poses_at(point)
    rows = [(name, f"     {where}: {len(poses)} records")]
    for one in poses:
        named = f"{point}.{one.orientation}"
        reference = "  reference" if one.orientation == 1 else ""
        rows.append((named, f"     {named:>7}  {_angles(one.pose)}{reference}"))
    for number, out in draft.removed_at(point):
        near = f", and within {out.within_deg:.1f} deg" if out.within_deg else ""
        rows.append((f"r{number}", f"{OUT}  {f'r{number}':>7}  {_angles(out.pose)}{near}"))
    return rows


def _angles(pose: tuple[float, float, float, float, float, float]) -> str:
    return "  ".join(f"{axis} {value:6.1f}" for axis, value in zip("abc", pose[3:], strict=True)) + " deg"


def removed_text(draft: PlanDraft) -> str:
    """What is left out, and what that costs; empty if nothing is."""
    if draft.removed == NOTHING_REMOVED:
        return ""
    what = f"Left out: {removed_summary(draft.removed)}."
    return f"{what} {_cost(draft.whole, draft.tried)}" if draft.is_tried else what


def removed_summary(removed: RemovedPoses) -> str:
    """How many poses, and which points, are left out."""
    poses = len(removed.poses)
    parts = [f"{poses} pose{'s' * (poses > 1)}"] if poses else []
    parts += [f"point {point}" for point in removed.points]
    return ", ".join(parts)


def _cost(before: PlanPreview, after: PlanPreview) -> str:
    """The predicted accuracy without something, beside that of the whole plan."""
    if after.error_mm is None or before.error_mm is None:
        return "What that costs cannot be predicted: no simulated robot could be calibrated with it."
    lost = after.error_mm - before.error_mm
    kind = f"costs {lost:.3f} mm" if lost > 0.0005 else "costs no accuracy"
    expanded = ""
    if before.expanded_mm is not None and after.expanded_mm is not None:
        expanded = f", U {after.expanded_mm:.3f} instead of {before.expanded_mm:.3f} mm"
    return (
        f"That {kind}: predicted error at the task {after.error_mm:.3f} instead of {before.error_mm:.3f} mm"
        f"{expanded}, {after.records} instead of {before.records} records, {duration(after.minutes)} "
        f"instead of {duration(before.minutes)}."
    )
