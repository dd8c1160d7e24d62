"""The plan carried out on simulated robots in a process of its own; prints text and poses as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from hexacell.cell.loader import load_cell
from hexacell.errors import HexacellError
from hexacell.services.offline import try_plan
from hexacell.text.planning import plan_trial_lines


def tried_plan_document(path: Path) -> dict[str, Any]:
    """What the plan is expected to give, and its poses; or why it cannot be tried."""
    try:
        trial = try_plan(load_cell(path))
    except HexacellError as error:
        return {"lines": [str(error)], "poses": []}
    poses = [(point, number, pose.as_tuple()) for point, number, pose in trial.result.visited]
    return {"lines": list(plan_trial_lines(trial)), "poses": poses}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(tried_plan_document(Path(sys.argv[1]))))
