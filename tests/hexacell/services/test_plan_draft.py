"""Poses are taken out of a plan and put back; what that costs is said once it was tried."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hexacell.campaign.removed_poses import NOTHING_REMOVED
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.errors import UsageError
from hexacell.services.preflight.plan_draft import PlanDraft, PlannedPose, PlanPreview
from hexacell.text.plan_draft import plan_rows, removed_text
from hexacell.text.screens.planned_poses import EVERYTHING, NOT_TRIED, plan_view

SETTINGS = load_cell(bundled_config("simulated-hexaglide")).settings
TILTS = (0.0, 12.0, -25.0)


def preview(error_mm: float | None = 0.075, records: int = 15) -> PlanPreview:
    poses = tuple(
        PlannedPose(point=point, orientation=row, pose=(*at, tilt, 0.0, 0.0))
        for point, at in enumerate(SETTINGS.identification.points, start=1)
        for row, tilt in enumerate(TILTS, start=1)
    )
    return PlanPreview(poses=poses, records=records, minutes=30.0, error_mm=error_mm, expanded_mm=0.15)


@pytest.fixture
def draft() -> PlanDraft:
    return PlanDraft(SETTINGS, preview(), preview())


def names(draft: PlanDraft) -> list[str]:
    return [name for name, _ in plan_rows(draft)]


def lines(draft: PlanDraft) -> dict[str, str]:
    return dict(plan_rows(draft))


def test_every_point_and_pose_has_a_row(draft: PlanDraft) -> None:
    assert names(draft)[:5] == ["1", "1.1", "1.2", "1.3", "2"]
    assert lines(draft)["1"].strip() == "point 1, x 0.0  y 0.0  z 550.0: 3 records"
    assert lines(draft)["1.1"].endswith("reference")
    assert removed_text(draft) == ""


def test_a_pose_that_is_taken_out_can_be_put_back(draft: PlanDraft) -> None:
    out = draft.toggled("2.3")
    assert "2.3" not in names(out)
    assert lines(out)["r1"] == "OUT       r1  a  -25.0  b    0.0  c    0.0 deg, and within 5.0 deg"
    assert removed_text(out) == "Left out: 1 pose."
    assert not out.removed.refused.allows((0.0, -200.0, 550.0, -25.0, 0.0, 0.0))
    both = out.toggled("3.2")
    assert both.toggled("r1").removed.poses == both.removed.poses[1:]
    assert both.toggled("r2").toggled("r1").removed == NOTHING_REMOVED


def test_a_point_that_is_taken_out_can_be_put_back(draft: PlanDraft) -> None:
    out = draft.toggled("4")
    assert out.removed.points == (4,)
    assert [name for name in names(out) if name.startswith("4")] == ["4"]
    assert lines(out)["4"].startswith("OUT  point 4")
    assert out.toggled("4").removed == NOTHING_REMOVED


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("6", "no point 6"),
        ("1.9", "no 1.9 in the plan"),
        ("r1", "no r1 in the plan"),
        ("nonsense", "no nonsense in the plan"),
        ("2.1", "2.1 is the reference of point 2"),
    ],
)
def test_what_is_not_there_cannot_be_taken_out(draft: PlanDraft, name: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        draft.toggled(name)


def test_two_points_must_be_left(draft: PlanDraft) -> None:
    few = draft.toggled("1").toggled("2").toggled("3")
    with pytest.raises(UsageError, match="1 of 5 points would be left"):
        few.toggled("4")


def test_what_it_costs_is_said_once_it_was_tried(draft: PlanDraft) -> None:
    out = draft.toggled("3").toggled("2.2")
    tried = out.after(preview(0.0904, 11), out.removed)
    assert removed_text(tried) == (
        "Left out: 1 pose, point 3. That costs 0.015 mm: predicted error at the task 0.090 instead of "
        "0.075 mm, U 0.150 instead of 0.150 mm, 11 instead of 15 records, 30 minutes instead of 30 minutes."
    )
    assert "costs no accuracy" in removed_text(out.after(preview(0.0752), out.removed))
    assert "cannot be predicted" in removed_text(out.after(preview(None), out.removed))


def test_a_trial_of_something_else_does_not_count(draft: PlanDraft) -> None:
    out = draft.toggled("3")
    late = out.after(preview(0.2), NOTHING_REMOVED)
    assert late == replace(out, is_tried=False)


def test_the_screen_says_where_there_is_no_plan_yet(draft: PlanDraft) -> None:
    assert plan_view(None).note == NOT_TRIED
    assert plan_view(draft).note == EVERYTHING
    assert len(plan_view(draft).rows) == 5 * 4
