"""Text for the screen on which poses are taken out of a plan."""

from __future__ import annotations

from hexacell.services.preflight.plan_draft import PlanDraft
from hexacell.text.plan_draft import plan_rows, removed_text
from hexacell.text.screens.live import TRYING
from hexacell.text.screens.views import PlanView

NOT_TRIED = "v in 2 Preflight tries the plan; then its poses are here."
EVERYTHING = "These poses were measured on a simulated robot; a real one is sent to others near them."


def plan_view(draft: PlanDraft | None, *, is_trying: bool = False) -> PlanView:
    """The poses; none before the plan was tried."""
    trying = f" {TRYING}" if is_trying else ""
    if draft is None:
        return PlanView(TRYING if is_trying else NOT_TRIED)
    return PlanView(f"{removed_text(draft) or EVERYTHING}{trying}", plan_rows(draft))
