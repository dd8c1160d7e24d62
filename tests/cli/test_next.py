"""``hexacell next``: called record by record by an independent program."""

import csv
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexacell.design.search_effort import SearchEffort
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.services import search_effort
from tests.geometries import hexaglide_geometry

HEADER = ["point", "orientation", *"xyzabc", *(f"q{leg}" for leg in range(1, 7)), "dx", "dy", "dz"]
NOISE_MM = 0.01
TRAVEL_MM = 5.0

PROMISED = {
    "done": bool,
    "point": int,
    "orientation": int,
    "reference": bool,
    "pose": dict,
    "joint_targets": list,
    "predicted_deviation": list,
    "sigma": list,
    "gain": float,
    "predicted_worst_sigma_mm": float,
}


class Stranger:
    """Another program with its own robot and gauges: it sends poses, reads, and writes lines of CSV."""

    def __init__(self, cell: Path, controller: Path, file: Path, noise_mm: float = NOISE_MM) -> None:
        truth = tomllib.loads(cell.read_text())["simulation"]["geometry"]
        config = tomllib.loads(controller.read_text())["geometry"]
        self.truth = hexaglide_geometry(truth["S"], truth["B"], truth["l"])
        self.believed = hexaglide_geometry(config["S"], config["B"], config["l"])
        self.branch = tuple(config["branch"])
        self.file, self.noise_mm = file, noise_mm
        self.random = np.random.default_rng(4)
        self.zero = np.zeros(3)
        self.farthest = 0.0
        with file.open("w") as stream:
            csv.writer(stream).writerow(HEADER)

    def measure(self, asked: dict[str, Any]) -> None:
        """Go to the proposed pose, read, and append a line."""
        pose = [asked["pose"][name] for name in "xyzabc"]
        command = PoseBatch.of([Pose(*pose)])
        joints = inverse_kinematics(Hexaglide(), self.believed, self.branch, command)
        np.testing.assert_allclose(joints[0], asked["joint_targets"], atol=1e-6)
        really = continue_solution(
            Hexaglide(),
            self.truth,
            joints,
            start=command,
            start_geometry=self.believed,
            start_joints=joints,
        )
        assert really.found[0]
        ball = really.poses.positions[0] + self.noise_mm * self.random.standard_normal(3)
        if asked["reference"]:
            self.zero = ball
        deviation = ball - self.zero
        self.farthest = max(self.farthest, float(np.abs(deviation).max()))
        sliders = joints[0] + self.noise_mm * self.random.standard_normal(6)
        with self.file.open("a") as stream:
            row = [asked["point"], asked["orientation"], *pose, *sliders, *deviation]
            csv.writer(stream).writerow(row)

    def continue_solution(self, ask: Callable[[], dict[str, Any]]) -> list[dict[str, Any]]:
        """Measure every proposed pose until it is done; all documents."""
        said: list[dict[str, Any]] = []
        while not said or not said[-1]["done"]:
            said.append(ask())
            if not said[-1]["done"]:
                self.measure(said[-1])
        return said


def asking(typed: Any, folder: Any, file: Path) -> Callable[[], dict[str, Any]]:
    def ask() -> dict[str, Any]:
        outcome = typed("next", folder.cell, "--measurements", file, "--json")
        assert (outcome.code, outcome.err) == (0, "")
        document: dict[str, Any] = outcome.document
        return document

    return ask


@pytest.fixture
def stranger(cell_folder: Any, tmp_path: Path) -> Stranger:
    return Stranger(cell_folder.cell, cell_folder.controller, tmp_path / "m.csv")


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Choose among few poses in this process; the quality of the choice is not under test."""
    monkeypatch.setattr(search_effort, "EFFORT", SearchEffort(candidates=128))


def test_a_campaign_by_next_ends_with_all_points_measured(typed_here, short_cell, stranger):
    before = short_cell.snapshot()
    said = stranger.continue_solution(asking(typed_here, short_cell, stranger.file))
    assert short_cell.snapshot() == before
    *asked, end = said
    assert [(one["point"], one["orientation"]) for one in asked] == [
        (point, n) for point in (1, 2) for n in range(1, 8)
    ]
    for one in asked:
        assert all(type(one[name]) is kind for name, kind in PROMISED.items())
        assert sorted(one["pose"]) == sorted("xyzabc")
        assert (len(one["joint_targets"]), len(one["predicted_deviation"]), len(one["sigma"])) == (6, 3, 3)
        assert one["reference"] == (one["orientation"] == 1)
        reach = np.abs(one["predicted_deviation"]) + 3.0 * np.array(one["sigma"])
        assert reach.max() <= TRAVEL_MM
        assert one["predicted_worst_sigma_mm"] <= one["present_worst_sigma_mm"]
        assert one["going_on"]["gain_mm"] >= 0.0
        assert one["present_expanded_mm"] == pytest.approx(2.0 * one["present_worst_sigma_mm"])
        assert one["going_on"]["expanded_mm"] == pytest.approx(2.0 * one["going_on"]["worst_sigma_mm"])
    assert [one["going_on"]["records"] for one in asked] == list(range(14, 0, -1))
    assert end["done"] is True
    assert end["reason"] == "all 2 points are measured"
    assert stranger.farthest < TRAVEL_MM
    assert asked[-1]["predicted_worst_sigma_mm"] < 0.15 * asked[0]["predicted_worst_sigma_mm"]
    fit = typed_here("fit", short_cell.cell, "--measurements", stranger.file, "--json")
    assert fit.code in {0, 1}
    assert fit.document["records"] == 14


def test_a_file_that_is_empty_or_has_a_header_alone_starts_a_campaign(typed_here, cell_folder, tmp_path):
    for text in (",".join(HEADER) + "\n", "", "\n\n"):
        (tmp_path / "m.csv").write_text(text)
        outcome = typed_here("next", cell_folder.cell, "--measurements", "m.csv", "--json")
        assert (outcome.code, outcome.err) == (0, "")
        said = outcome.document
        assert (said["point"], said["orientation"], said["reference"]) == (1, 1, True)
        assert said["pose"] == {"x": 0.0, "y": 0.0, "z": 550.0, "a": 0.0, "b": 0.0, "c": 0.0}


def test_the_same_file_gets_the_same_answer_and_a_refused_pose_another(typed_here, cell_folder, stranger):
    ask = asking(typed_here, cell_folder, stranger.file)
    stranger.measure(ask())
    first = ask()
    assert ask() == first
    again = ("next", cell_folder.cell, "--measurements", stranger.file)
    refused = typed_here(*again, "--refused", "1", "--json").document
    assert refused["orientation"] == first["orientation"]
    assert refused["pose"] != first["pose"]
    given_up = typed_here(*again, "--refused", "4", "--json").document
    assert (given_up["point"], given_up["reference"]) == (2, True)
    text = typed_here(*again).out
    assert "Point 1, orientation 2: go to X" in text
    assert "continuing" in text
    assert max(map(len, text.splitlines())) <= 80


def test_files_and_counts_that_cannot_be_used(typed_here, cell_folder, stranger):
    stranger.measure(asking(typed_here, cell_folder, stranger.file)())
    header, row = stranger.file.read_text().splitlines()
    many = "\n".join(f"1,{n}," + ",".join(["0"] * 15) for n in range(1, 502))
    ask = ("next", cell_folder.cell, "--measurements", stranger.file, "--json")
    for rows, words in (
        (f"9{row[1:]}", "records of point 9, but the cell file has 5 points"),
        (row.replace(",550.0,", ",abc,", 1), ':2: z is "abc"'),
        (many, "there are 501 records; a next pose is found for 500"),
    ):
        stranger.file.write_text(f"{header}\n{rows}\n")
        outcome = typed_here(*ask)
        assert outcome.code == outcome.document["exit_code"] == 2
        assert words in outcome.err
    refused = typed_here(*ask, "--refused", "-1")
    assert (refused.code, "--refused" in refused.err) == (2, True)
