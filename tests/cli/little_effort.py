"""``hexacell`` with few choices of poses, a program of its own for tests in which poses do not matter."""

import sys
from unittest.mock import AsyncMock

from hexacell.__main__ import main
from hexacell.design.search_effort import SearchEffort
from hexacell.services import search_effort
from hexacell.services.write_back import proposals

if __name__ == "__main__":
    search_effort.EFFORT = SearchEffort(
        candidates=64,
        held_out_candidates=128,
        checked_candidates=8,
        checked_robots=4,
        rounds=(),
        late_rounds=(),
    )
    if "apply" in sys.argv:  # of a run without records
        proposals.require_as_recorded = AsyncMock()
    sys.exit(main())
