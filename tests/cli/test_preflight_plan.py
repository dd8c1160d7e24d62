"""Preflight of the plan: an infeasible plan is refused with the reason, others get a prediction."""

import re
from collections.abc import Callable
from typing import Any

import pytest

P5 = "[-100.0, 100.0, 500.0],\n]\norientations = 17"


pytestmark = pytest.mark.usefixtures("never_moves")

FREE = (
    ("turn_deg = 60.0", "turn_deg = 180.0"),
    ("leg_distance_mm = 30.0", "leg_distance_mm = 0.0"),
    ("base_cone_deg = 45.0", "base_cone_deg = 180.0"),
    ("platform_cone_deg = 45.0", "platform_cone_deg = 180.0"),
)
"""Passive joints and legs as if they were not limited."""

IMPOSSIBLE: dict[str, tuple[tuple[tuple[str, str], ...], tuple[str, ...]]] = {
    "travel": (
        (("gauge_travel_mm = 5.0", "gauge_travel_mm = 0.05"), ("mounting_mm = 1.0", "mounting_mm = 0.0")),
        ("identification point 1: no orientation surely keeps the ball inside", "gauge_travel_mm = 0.05"),
    ),
    "tolerances": ((("S_mm = 7.0", "S_mm = 150.0"),), ("identification point 1", "cannot reach it")),
    "tilt": (
        (("tilt_deg = 45.0", "tilt_deg = 0.5"),),
        ("at the worst task pose, one sigma, where the limit is 0.3", "Allow more tilt"),
    ),
    "budget": (
        (("orientations = 17", "orientations = 17\nbudget_records = 12"),),
        ("the budget of 12 records allows 12 records at 1 points, 33 equations for 35", "Allow 13 records"),
    ),
    "a way across a singularity": (
        ((P5, "[111.0, 15.0, -266.0],\n]\norientations = 17"), *FREE),
        ("identification points 4 and 5: the straight line between them", "change their order"),
    ),
}


@pytest.mark.parametrize(
    ("command", "name"), [*(("preflight", name) for name in IMPOSSIBLE), ("run", "budget")]
)
def test_a_cell_that_cannot_be_calibrated_is_refused_with_the_reason(
    typed_here: Any, cell_folder: Any, command: str, name: str
) -> None:
    edits, words = IMPOSSIBLE[name]
    cell_folder.edit(*edits)
    before = cell_folder.snapshot()
    outcome = typed_here(command, cell_folder.cell, "--json")
    assert outcome.code == outcome.document["exit_code"] == 2, outcome.err
    for word in words:
        assert word in outcome.err
    assert cell_folder.snapshot() == before


WIDE = (
    ("position_mm = 0.3 ", "position_mm = 20.0 "),
    ("orientation_deg = 0.08 ", "orientation_deg = 5.0 "),
)
"""Limits that any robot of the cell passes."""


@pytest.mark.usefixtures("few_candidates", "one_robot")
def test_the_predicted_accuracy_is_printed_before_any_motion(typed_here: Any, cell_folder: Any) -> None:
    cell_folder.edit(("orientations = 17", "orientations = 7"), *WIDE)
    before = cell_folder.snapshot()
    outcome = typed_here("preflight", cell_folder.cell, "--json")
    assert outcome.code == 0
    expected = outcome.document["expected"]
    assert expected["robots"] == 1
    assert 14 <= expected["records"] <= 35
    assert expected["points"] == 5
    assert expected["outside"] <= 1
    assert 0.02 < expected["worst_sigma_mm"] < 1.0
    assert 1.0 < expected["minutes"] < 40.0
    assert all(0.0 <= share < 0.3 for share in expected["lost"].values())
    verdicts = expected["verdicts"]
    assert sum(verdicts["probabilities"].values()) == pytest.approx(1.0)
    limits = {"position_mm": 20.0, "orientation_deg": 5.0, "guard_band_factor": 1.5}
    assert verdicts["limits"] == limits
    assert verdicts["probabilities"]["pass"] == pytest.approx(0.997, abs=0.001)
    assert 0.02 < verdicts["passing"]["position_mm"] < 4.0
    assert expected["averaging"][2]["windows"] == 4
    assert 0.4 < expected["averaging"][2]["error_mm"] / expected["averaging"][0]["error_mm"] < 0.6
    assert 0.0 < expected["encoders_part_mm"] < expected["averaging"][0]["error_mm"]
    said = re.sub(r"\s+", " ", outcome.err)
    assert "A healthy machine of this cell passes with a probability of 99.7%." in said
    assert "The noise of the encoders makes about 0." in said
    words = r"\d+ records at 5 points will give about 0\.\d{3} mm at the worst of your task poses"
    assert re.search(
        rf"{words} \(one sigma\), in about [\d.]+ minutes: moving [\d.]+, reading [\d.]+", said
    )
    assert re.search(r"Sooner \(.* budget_minutes\) U would be larger: \d+ minutes \d\.\d+ mm, ", said)
    assert cell_folder.snapshot() == before


FIXED = [f"{point},{n}" for point in range(1, 6) for n in range(1, 12)]
"""Labels of as many poses as the cell has."""


def listed(cell_folder: Any, change: Callable[[list[str]], list[str]]) -> str:
    """A list of small tilts at the cell's points, changed in some way; the name of its file."""
    points = ["0,0,550", "0,-200,550", "100,-100,500", "100,0,600", "-100,100,500"]
    rows = []
    for label in FIXED:
        point, n = map(int, label.split(","))
        angle = 0.2 * n * (n - 1)
        turn = [f"{angle},0,0", f"0,{angle},0", f"0,0,{angle}"][n % 3]
        rows.append(f"{label},{points[point - 1]},{turn}")
    name = "list.csv"
    (cell_folder.path / name).write_text(
        "point,orientation,x,y,z,a,b,c\n" + "".join(f"{row}\n" for row in change(rows))
    )
    cell_folder.edit(("orientations = 17", f'orientations = 17\nposes = "{name}"'))
    return name


LISTS: dict[str, tuple[Callable[[list[str]], list[str]], tuple[str, ...]]] = {
    "a point too many": (lambda rows: [*rows, "6,1,0,0,550,0,0,0"], ("list.csv:57: there is no point 6",)),
    "a point with one pose": (lambda rows: rows[:45], ("point 5 has one pose",)),
    "too few": (
        lambda rows: [row for row in rows if int(row.split(",")[1]) <= 3],
        ("30 equations for 35 parameters", "at least 4 orientations"),
    ),
    "a way across a singularity": (
        lambda rows: [*rows, "1,12,0,0,550,10,-10,169"],
        ("point 1, poses 11 and 12 of the list: the straight line between them",),
    ),
    "out of reach, too steep and elsewhere, all at once": (
        lambda rows: [*rows, "1,12,0,0,1550,0,0,0", "2,12,0,-200,550,46,0,0", "3,12,60,-100,500,0,0,0"],
        (
            "point 1, pose 12 of the list: leg ",
            "point 2, pose 12 of the list: is tilted by 46.0 deg, beyond tilt_deg = 45",
            "point 3, pose 12 of the list: is 40.0 mm from its reference, where the gauges reach 5",
        ),
    ),
}


@pytest.mark.parametrize("name", LISTS)
def test_a_list_of_poses_goes_through_the_same_preflight(typed_here, cell_folder, name) -> None:
    change, words = LISTS[name]
    listed(cell_folder, change)
    cell_folder.edit(*FREE)
    outcome = typed_here("preflight", cell_folder.cell, "--json")
    assert outcome.code == outcome.document["exit_code"] == 2
    for word in words:
        assert word in outcome.err


@pytest.mark.slow
@pytest.mark.usefixtures("one_robot")
def test_a_list_of_poses_that_can_be_measured(typed_here: Any, cell_folder: Any) -> None:
    """Gauges with a long travel can measure it even on an uncalibrated robot."""
    listed(cell_folder, lambda rows: rows)
    cell_folder.edit(("gauge_travel_mm = 5.0", "gauge_travel_mm = 60.0"))
    for protocol in ("sylvac", "mux10", "cdi"):
        cell_folder.edit((f'protocol = "{protocol}"', f'travel_mm = 130\nprotocol = "{protocol}"'))
    outcome = typed_here("preflight", cell_folder.cell, "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.document["expected"]["records"] >= 40
    assert outcome.document["expected"]["outside"] == 0


def test_a_list_of_poses_with_choose_points_is_refused(typed_here: Any, cell_folder: Any) -> None:
    listed(cell_folder, lambda rows: rows)
    cell_folder.edit(("orientations = 17", "orientations = 17\nchoose_points = true"))
    outcome = typed_here("preflight", cell_folder.cell)
    assert outcome.code == 2
    assert "a list of poses leaves no points to choose" in outcome.err
