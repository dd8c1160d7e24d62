"""The JSON document of an identification has the keys of the interface, and is valid always."""

import json

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.results.result import IdentificationResult, RecordResidual

# docs/interface.md, the document of fit --json; termination is an addition.
KEYS = (
    "chi2 converged covariance dof expected_chi2 frame geometry holds_at_c identifies iterations "
    "noise_freedom outliers parameters points records residual_rms_mm sigma termination terms undetermined"
)


def document_of(found):
    """As a reader gets it: through JSON, in which NaN and infinity have no place."""
    document = IdentificationResult.of(found).document(found.geometry.parameters)
    return json.loads(json.dumps(document, allow_nan=False))


@pytest.fixture(scope="module")
def document(identified):
    return document_of(identified)


def test_the_document_has_the_keys_of_the_interface(document):
    assert sorted(document) == KEYS.split()
    counts = {key: document[key] for key in ("frame", "records", "points", "dof", "converged")}
    assert counts == {"frame": "paper", "records": 55, "points": 5, "dof": 115, "converged": True}
    assert document["expected_chi2"] == pytest.approx(115.0, abs=0.1)
    assert document["undetermined"] == document["outliers"] == []
    assert isinstance(document["iterations"], int)
    assert 0.005 < document["residual_rms_mm"] < 0.05
    assert 60.0 < document["chi2"] < 180.0
    for part in (document["geometry"], document["sigma"]):
        shapes = {name: np.shape(values) for name, values in part.items()}
        assert shapes == {"S": (6, 3), "B": (6, 3), "l": (6,)}


def test_residuals_are_what_the_found_geometry_leaves_of_each_record(identified, noisy):
    residuals = RecordResidual.of_records(identified)
    assert [(one.point, one.orientation) for one in residuals] == [one.id for one in noisy.records]
    positions = identified.poses.positions
    for point in range(1, 6):
        rows = [row for row, one in enumerate(noisy.records) if one.point == point]
        left = [np.subtract(noisy.records[row].deviation, positions[row]) for row in rows]
        # What they have in common is the unknown place of the gauges.
        between = np.array([residuals[row].mm for row in rows])
        np.testing.assert_allclose(between - between[0], np.subtract(left, left[0]), atol=1e-9)
    sigmas = np.array([one.sigmas for one in residuals])
    assert 1.0 < np.median(sigmas) < 1.6, "the largest of three; of normal ones 1.26"
    assert sigmas.max() < 4.5


def test_the_covariance_is_in_the_order_of_the_geometry(document):
    covariance = np.array(document["covariance"])
    assert covariance.shape == (42, 42)
    np.testing.assert_array_equal(covariance, covariance.T)
    sigma = document["sigma"]
    in_order = [*np.ravel(sigma["S"]), *np.ravel(sigma["B"]), *sigma["l"]]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), in_order, rtol=1e-12)
    fixed = [row for row in range(42) if not covariance[row].any()]
    assert [HEXAGLIDE_PARAMETERS.names[row] for row in fixed] == ["S2x", "S2y", "S2z", "S3z"]


def test_outliers_and_undetermined_parameters_are_named(visit, make_problem):
    measured = visit(degrees=4.0, seed=1).measured(0.01, seed=1)
    records = list(measured.records)
    bad = records[17]
    shifted = (bad.deviation[0] + 1.0, *bad.deviation[1:])
    records[17] = type(bad)(bad.point, bad.orientation, bad.pose, bad.joints, shifted)
    document = document_of(identify(make_problem(type(measured)(tuple(records)))))
    (outlier,) = document["outliers"]
    assert (outlier["point"], outlier["orientation"]) == (2, 7)
    assert (outlier["kind"], outlier["gauges"]) == ("gross error", ["x"])
    assert outlier["off_mm"] == pytest.approx([1.0, 0.0, 0.0], abs=0.2)
    assert document["records"] == 54
    assert "S4z" in document["undetermined"]
    assert set(document["undetermined"]) <= set(HEXAGLIDE_PARAMETERS.names)


def test_a_record_without_a_pose_gives_valid_json(noisy, make_problem):
    records = list(noisy.records)
    bad = records[20]
    apart = tuple(np.add(bad.joints, [-300, -300, -300, 300, 300, 300]).tolist())
    records[20] = type(bad)(bad.point, bad.orientation, bad.pose, apart, bad.deviation)
    document = document_of(identify(make_problem(type(noisy)(tuple(records)))))
    (outlier,) = document["outliers"]
    assert (outlier["point"], outlier["orientation"]) == (bad.point, bad.orientation)
    assert outlier["off_mm"] is None
