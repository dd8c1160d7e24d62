"""The plan carried out on simulated robots in a process of its own; prints text and poses as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from hexacell.campaign.removed_poses import RemovedPoses
from hexacell.cell.loader import load_cell
from hexacell.errors import HexacellError
from hexacell.services.offline import try_plan
from hexacell.services.preflight.plan_draft import preview_of
from hexacell.text.planning import plan_trial_lines


def tried_plan_document(path: Path, removed: RemovedPoses) -> dict[str, Any]:
    """What the plan is expected to give, and its poses; or why it cannot be tried."""
    try:
        trial = try_plan(load_cell(path), removed)
    except HexacellError as error:
        return {"lines": [str(error)], "preview": None}
    preview = preview_of(trial).model_dump(mode="json")
    return {"lines": list(plan_trial_lines(trial)), "preview": preview if trial.result.robots else None}


if __name__ == "__main__":
    what = RemovedPoses.model_validate_json(sys.argv[2])
    sys.stdout.write(json.dumps(tried_plan_document(Path(sys.argv[1]), what)))
