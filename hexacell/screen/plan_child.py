"""The plan carried out on simulated robots in a process of its own; prints lines of text as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from hexacell.application.offline import try_plan
from hexacell.cell.loader import load_cell
from hexacell.errors import HexacellError
from hexacell.presentation.planning import plan_trial_lines


def planned_lines(path: Path) -> list[str]:
    """What the plan is expected to give, or why it cannot be tried."""
    try:
        return list(plan_trial_lines(try_plan(load_cell(path))))
    except HexacellError as error:
        return [str(error)]


if __name__ == "__main__":
    sys.stdout.write(json.dumps(planned_lines(Path(sys.argv[1]))))
