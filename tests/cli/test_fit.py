"""``hexacell fit``: the same result from a file, and every mistake that a file can have."""

from __future__ import annotations

import json
import re
import shutil
import tomllib

import numpy as np
import pytest

from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.measurements.csv_file import HEADER
from tests.geometries import hexaglide_geometry

SHAPES = {"S": (6, 3), "B": (6, 3), "l": (6,)}


@pytest.fixture(scope="session")
def records(demo) -> list[str]:
    """The demo's measurement file, line by line."""
    return str((demo.run / "measurements.csv").read_text()).splitlines()


def fit(typed, cell_folder, measurements="m.csv", *arguments):
    return typed("fit", cell_folder.cell, "--measurements", measurements, *arguments)


@pytest.mark.parametrize("config", ["config-before", "config-after"])
def test_the_demos_records_give_the_demos_geometry(typed_here, demo, cell_folder, config):
    """Whether the controller's config has the old geometry or the new one."""
    shutil.copy(demo.run / config, cell_folder.controller)
    outcome = fit(typed_here, cell_folder, demo.run / "measurements.csv", "--json")
    assert outcome.code == 0
    expected = json.loads((demo.run / "result.json").read_text())["geometry"]
    for name, shape in SHAPES.items():
        found = np.array(outcome.document["geometry"][name])
        assert found.shape == shape
        assert np.abs(found - expected[name]).max() < 1e-9


def test_the_document_is_as_documented(typed, demo):
    outcome = typed("fit", demo.cell, "--measurements", demo.run / "measurements.csv", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    document = outcome.document
    # A set ends early where no orientation is surely safe any more, and the noise differs every time.
    rows = (demo.run / "measurements.csv").read_text().splitlines()[1:]
    assert 50 <= len(rows) <= 55
    # The run rejected the same records; in one file of a hundred a good one is rejected by chance.
    assert document["outliers"] == json.loads((demo.run / "result.json").read_text())["outliers"]
    assert len(document["outliers"]) <= 1
    assert document["records"] == len(rows) - len(document["outliers"])
    assert (document["points"], document["converged"]) == (5, True)
    assert document["frame"] == "paper"
    assert document["undetermined"] == []
    covariance = np.array(document["covariance"])
    sigma = np.concatenate([np.ravel(document["sigma"][name]) for name in "SBl"])
    assert covariance.shape == (42, 42)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sigma, rtol=1e-9)
    assert np.count_nonzero(sigma == 0.0) == 4
    assert document["dof"] == 3 * document["records"] - 3 * 5 - 35
    assert 0.5 < document["chi2"] / document["dof"] < 1.5


def test_the_text_has_a_line_for_every_free_parameter(typed_here, demo):
    outcome = typed_here("fit", demo.cell, "--measurements", demo.run / "measurements.csv")
    assert (outcome.code, outcome.err) == (0, "")
    text = " ".join(outcome.out.split())
    measured = len((demo.run / "measurements.csv").read_text().splitlines()) - 1
    records = measured - text.count("the record is left out")
    assert f"35 parameters from {records} records at 5 points" in text
    assert max(map(len, outcome.out.splitlines())) <= 80
    rows = re.findall(r"^([SB][1-6][xyz]|l[1-6]) +(\S+) +(\S+) +(\S+)", outcome.out, flags=re.MULTILINE)
    assert len({name for name, *_ in rows}) == len(rows) == 42 - 4
    for _, old, new, change in rows:
        assert float(new) - float(old) == pytest.approx(float(change), abs=0.0011)


def test_too_few_records_are_refused(typed_here, cell_folder, tmp_path, records):
    (tmp_path / "m.csv").write_text("\n".join([*records[:3], *records[12:14]]))
    outcome = fit(typed_here, cell_folder, "m.csv", "--json")
    assert outcome.code == 1
    assert outcome.document["exit_code"] == 1
    assert "Measure" in outcome.err


MISTAKES = {
    "text": (
        lambda r: [*r[:4], f"{r[4].rpartition(',')[0]},abc", *r[5:]],
        ':5: dz is "abc", but must be a finite',
    ),
    "no header": (lambda r: r[1:], ":1: columns are missing: point, orientation"),
    "point with one row": (lambda r: r[:13], ":13: point 2 has one row, and at least two are needed"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_file_is_named_with_its_line(typed_here, cell_folder, tmp_path, records, mistake):
    spoil, words = MISTAKES[mistake]
    (tmp_path / "m.csv").write_text("".join(line + "\n" for line in spoil(records)))
    before = cell_folder.snapshot()
    outcome = fit(typed_here, cell_folder, "m.csv", "--json")
    assert outcome.code == outcome.document["exit_code"] == 2
    assert outcome.err.startswith("hexacell: m.csv")
    assert words in outcome.err
    assert cell_folder.snapshot() == before


def small_tilts(cell_folder, degrees: float) -> list[str]:
    """Records of a robot that is as its config says, with noise, at tilts up to some degrees."""
    config = tomllib.loads(cell_folder.controller.read_text())["geometry"]
    geometry, random = hexaglide_geometry(config["S"], config["B"], config["l"]), np.random.default_rng(1)
    rows = []
    for point, position in enumerate([(0.0, 0.0, 550.0), (0.0, -200.0, 550.0), (100.0, 0.0, 600.0)], 1):
        tilts = [np.zeros(3), *random.uniform(-degrees, degrees, (14, 3))]
        commands = PoseBatch.of([Pose(*position, *tilt) for tilt in tilts])
        joints = inverse_kinematics(Hexaglide(), geometry, tuple(config["branch"]), commands)
        joints = joints + random.normal(0.0, 0.01, joints.shape)
        deviations = random.normal(0.0, 0.01, (len(tilts), 3))
        deviations -= deviations[0]
        rows += [
            ",".join(map(str, (point, n + 1, *position, *tilts[n], *joints[n], *deviations[n])))
            for n in range(len(tilts))
        ]
    return [",".join(HEADER), *rows]


def test_records_that_determine_nothing_are_no_result(typed_here, cell_folder, tmp_path):
    (tmp_path / "m.csv").write_text("\n".join(small_tilts(cell_folder, 0.15)))
    outcome = fit(typed_here, cell_folder)
    assert outcome.code == 1, outcome.err
    assert outcome.out.startswith("Not usable: ")
    assert " of 35 parameters are not determined by these data." in " ".join(outcome.out.split())


def test_many_records_are_told_before_they_are_used(typed_here, demo, tmp_path, records):
    more = [f"{2 * n + 10}{row[1:]}" for n in range(5) for row in records[1:12]]
    (tmp_path / "m.csv").write_text("\n".join([*records, *more]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hexacell.cli.commands.records.MANY_RECORDS", 100)
        outcome = typed_here("fit", demo.cell, "--measurements", "m.csv")
    assert "records: this takes some 2 seconds\n" in outcome.err
