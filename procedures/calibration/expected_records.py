"""How many records a run takes at most, for its progress."""

from __future__ import annotations

from hexacell.campaign.pose_list import PoseList
from hexacell.cell.model import CellSettings
from procedures.calibration.workflow import Mode


def expected_records(
    settings: CellSettings, mode: Mode, listed: PoseList | None = None, *, length_check: bool = False
) -> int:
    """The largest number of settled readings in a whole run, closings of sets included."""
    fixture = settings.length_check
    length = 0 if fixture is None else fixture.mountings * (fixture.orientations + 2)
    if mode is Mode.LENGTH:
        return length
    plan, held_out = settings.identification, settings.verification
    points = len(held_out.points)
    verification = points * (held_out.orientations + 1)
    if mode is Mode.CHECK:
        return settings.check.budget_records + len(plan.points)
    records = len(plan.points) * plan.orientations if listed is None else len(listed)
    budget = settings.quick.budget_records if mode is Mode.QUICK else plan.budget_records
    identification = min(records, budget or records) + len(plan.points)
    calibration = identification + 2 * verification + points * (held_out.orientations - 1)
    return calibration + (length if length_check else 0)
