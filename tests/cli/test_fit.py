"""``hexacell fit``: the same result from a file, and every mistake that a file can have."""

import json
import shutil

import numpy as np
import pytest

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


def test_the_document_is_as_documented(typed_here, demo):
    outcome = typed_here("fit", demo.cell, "--measurements", demo.run / "measurements.csv", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    document = outcome.document
    # A set ends early where no orientation is surely safe any more, and the noise differs every time.
    rows = (demo.run / "measurements.csv").read_text().splitlines()[1:]
    assert 80 <= len(rows) <= 85
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


def test_too_few_records_are_refused(typed_here, cell_folder, tmp_path, records):
    (tmp_path / "m.csv").write_text("\n".join([*records[:3], *records[12:14]]))
    outcome = fit(typed_here, cell_folder, "m.csv", "--json")
    assert outcome.code == 1
    assert outcome.document["exit_code"] == 1
    assert "Measure" in outcome.err


def test_many_records_are_told_before_they_are_used(typed_here, demo, tmp_path, records):
    more = [f"{2 * n + 10}{row[1:]}" for n in range(5) for row in records[1:12]]
    (tmp_path / "m.csv").write_text("\n".join([*records, *more]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hexacell.cli.commands.records.MANY_RECORDS", 100)
        outcome = typed_here("fit", demo.cell, "--measurements", "m.csv")
    assert "records: this takes some 2 seconds\n" in outcome.err
