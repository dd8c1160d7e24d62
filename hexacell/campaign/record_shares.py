"""How many records each point gets: those planned at points that cannot be measured go to the others."""

from __future__ import annotations

from collections.abc import Mapping, Set

from hexacell.campaign.decisions import CampaignState

MOST = 2
"""Times the planned number: more records at one point hardly take the place of another point."""


def shared_sizes(planned: Mapping[int, int], state: CampaignState, left: Set[int]) -> dict[int, int]:
    """How many records each point gets at most, so that all points together get as many as planned.

    No point gets fewer than planned, though another one had more while this one seemed out of reach,
    and none more than ``MOST`` times as many.

    Args:
        planned: how many at each point.
        state: with the points that are done, whether they got their records or not.
        left: further points that cannot be measured as far as is known.
    """
    waiting = set(planned) - state.done - left
    if not waiting:
        return dict(planned)
    missing = sum(size - state.records_at(point) for point, size in planned.items() if point not in waiting)
    share = max(0, missing // len(waiting))
    return {
        point: min(size + share, MOST * size) if point in waiting else size
        for point, size in planned.items()
    }
