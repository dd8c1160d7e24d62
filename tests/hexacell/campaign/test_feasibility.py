"""Limits that no number of records reaches are refused before anything moves, with what can be reached."""

import re

from hexacell.campaign.feasibility import _beyond_any_records, records_for
from tests.hexacell.campaign.conftest import at_two_points

LOOSE = {"position_mm": 50.0, "orientation_deg": 50.0}


def refusals(stops_mm: float, **limits: float) -> list[str]:
    acceptance = {f"acceptance__{key}": value for key, value in (LOOSE | limits).items()}
    plan = at_two_points(noise__stops=stops_mm, **acceptance)
    return [str(error) for error in _beyond_any_records(plan)]


def test_a_limit_below_what_no_record_shows_is_refused_with_one_that_can_be_reached() -> None:
    [said] = refusals(0.1, position_mm=0.3)
    assert "stops of a slider beside its command" in said
    [proposed] = re.findall(r"State position_mm = ([0-9.]+) or more", said)
    assert refusals(0.1, position_mm=float(proposed)) == []
    assert refusals(0.0, position_mm=1e-4) == [], "the noise of readings falls with their number"


def test_the_number_of_records_for_a_limit_leaves_the_part_that_they_do_not_reduce() -> None:
    assert records_for(1.25, 50, 1.0, 0.75) == 50
    assert records_for(1.25, 50, 2.0, 0.75) == 200
    assert records_for(0.3, 50, 0.4, 0.3) is None
