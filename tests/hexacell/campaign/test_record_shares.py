"""Records that were planned at points out of reach are taken at the others, and no more than planned."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hexacell.campaign.budget import MOST_SHARE, shared_sizes
from hexacell.campaign.decisions import CampaignState
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record

PLANNED = {1: 11, 2: 11, 3: 11, 4: 11, 5: 11}


def measured(counts: dict[int, int], done: set[int], point: int | None = None) -> CampaignState:
    """A state with so many records at each point."""
    zeros = (0.0,) * 6, (0.0,) * 3
    records = tuple(
        Record(at, number, Pose(0.0, 0.0, 0.0), *zeros)
        for at, count in counts.items()
        for number in range(1, count + 1)
    )
    return CampaignState(MeasurementSet(records), point, frozenset(done))


def test_without_a_point_out_of_reach_all_get_what_is_planned() -> None:
    assert shared_sizes(PLANNED, measured({}, set()), set()) == PLANNED
    assert shared_sizes(PLANNED, measured({1: 11, 2: 4}, {1}, 2), set()) == PLANNED


def test_the_others_share_what_a_point_does_not_get() -> None:
    found = shared_sizes(PLANNED, measured({1: 11, 2: 4}, {1}, 2), {5})
    assert found == PLANNED | {2: 14, 3: 14, 4: 14}
    assert shared_sizes(PLANNED, measured({1: 3, 2: 5}, {1}, 2), set())[2] == 13, "8 among 4"


def test_the_last_point_gets_what_is_left() -> None:
    state = measured({1: 11, 2: 14, 3: 14, 4: 9}, {1, 2, 3}, 4)
    assert shared_sizes(PLANNED, state, {5})[4] == 16
    assert shared_sizes(PLANNED, measured({1: 11}, {1, 2, 3, 4, 5}), set()) == PLANNED


def test_a_point_that_is_in_reach_again_gets_what_was_planned_for_it() -> None:
    state = measured({1: 11, 2: 14, 3: 14}, {1, 2, 3}, 4)
    assert shared_sizes(PLANNED, state, set()) == PLANNED
    assert shared_sizes(PLANNED, measured({1: 22}, {1}), set()) == PLANNED


def test_one_point_does_not_take_the_place_of_all() -> None:
    assert shared_sizes(PLANNED, measured({1: 4}, set(), 1), {2, 3, 4, 5})[1] == 22


@given(
    st.lists(st.integers(0, 20), min_size=5, max_size=5),
    st.sets(st.integers(1, 5)),
    st.sets(st.integers(1, 5)),
)
def test_no_point_gets_fewer_than_planned_and_all_together_no_more(
    counts: list[int], done: set[int], left: set[int]
) -> None:
    state = measured(dict(zip(PLANNED, counts, strict=True)), done)
    sizes = shared_sizes(PLANNED, state, left)
    waiting = set(PLANNED) - done - left
    assert all(PLANNED[point] <= sizes[point] <= MOST_SHARE * PLANNED[point] for point in PLANNED)
    asked = sum(sizes[point] for point in waiting)
    taken = sum(state.records_at(point) for point in set(PLANNED) - waiting)
    planned = sum(PLANNED[point] for point in waiting)
    assert asked == planned or asked + taken <= sum(PLANNED.values())
