"""Another mechanism is one more file: everything else follows from its description."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, product
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.cell.by_mechanism import geometry_settings, tolerance_settings
from hexacell.config.toml_format import NativeToml
from hexacell.errors import FileError
from hexacell.identification.diagnostics.frame_alignment import choose_frames
from hexacell.identification.estimator import identify
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import Noise, Prior, Tolerances
from hexacell.identification.problem.problem import Assumptions
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, FrameTransform, Mechanism
from hexacell.kinematics.mechanisms.gough_stewart import (
    GOUGH_STEWART_PARAMETERS as PARAMETERS,
)
from hexacell.kinematics.mechanisms.gough_stewart import (
    THREE_LEGS_FRAME as CONVENTION,
)
from hexacell.kinematics.mechanisms.gough_stewart import GoughStewart
from hexacell.kinematics.parameters import ParameterKind, ParameterSet, ParameterUnit
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.results.result import IdentificationResult
from tests.geometries import gough_stewart_geometry

MECHANISM: Mechanism = GoughStewart()
BRANCH: Branch = ()
SIGNS = [1, 1, 1, 1, 1, 1]
TOLERANCES = Tolerances({"base": 2.0, "platform": 2.0, "offset": 1.0}, ball_mm=0.0)


def ring(radius: float, degrees: tuple[float, ...], height: float) -> Array:
    angles = np.radians(degrees)
    return np.stack(
        [radius * np.cos(angles), radius * np.sin(angles), np.full(len(angles), height)], axis=1
    )


@pytest.fixture(scope="module")
def drawing() -> Geometry:
    base = ring(350.0, (-50.0, 50.0, 70.0, 170.0, 190.0, 290.0), 0.0)
    platform = ring(160.0, (-10.0, 10.0, 110.0, 130.0, 230.0, 250.0), -30.0)
    drawn = gough_stewart_geometry(base, platform, np.full(6, 500.0))
    return MECHANISM.normalize_frames(drawn)[0]


@pytest.fixture(scope="module")
def truth(drawing: Geometry) -> Geometry:
    errors = np.random.default_rng(4).uniform(-1.0, 1.0, len(CONVENTION.free_names))
    return CONVENTION.geometry(CONVENTION.free_parameters(drawing) + errors)


def poses(drawing: Geometry, random: np.random.Generator) -> Iterator[tuple[int, int, Pose]]:
    """Orientations about the middle of the workspace, clear of singularities."""
    middle = drawing["base"].mean(axis=0) + np.array([0.0, 0.0, 420.0])
    for point, orientation in product(range(1, 6), range(1, 12)):
        shift = 60.0 * np.array([point % 3 - 1, point % 2, point - 3])
        while True:
            pose = Pose(*(middle + shift).tolist(), *random.uniform(-20.0, 20.0, 3).tolist())
            batch = PoseBatch.of([pose])
            joints = MECHANISM.inverse(drawing, BRANCH, batch)
            if singularity_margin(MECHANISM, drawing, batch, joints)[0] > 0.05:
                break
        yield point, orientation, pose


@pytest.fixture(scope="module")
def measurements(drawing: Geometry, truth: Geometry) -> MeasurementSet:
    points, orientations, commands = zip(*poses(drawing, np.random.default_rng(1)), strict=True)
    start = PoseBatch.of(commands)
    joints = MECHANISM.inverse(drawing, BRANCH, start)
    actual = continue_solution(
        MECHANISM, truth, joints, start=start, start_geometry=drawing, start_joints=joints
    )
    assert actual.found.all()
    balls, records = actual.poses.positions, []
    for row, (point, orientation, pose) in enumerate(zip(points, orientations, commands, strict=True)):
        deviation = balls[row] - balls[points.index(point)]
        records.append(
            Record(point, orientation, pose, tuple(joints[row].tolist()), tuple(deviation.tolist()))
        )
    return MeasurementSet(tuple(records))


def test_a_second_mechanism_is_identified_from_exact_records(
    drawing: Geometry, truth: Geometry, measurements: MeasurementSet
) -> None:
    problem = Assumptions(
        MECHANISM,
        controller=CommandingGeometry.of(MECHANISM, drawing),
        branch=BRANCH,
        prior=Prior.of(MECHANISM, drawing, TOLERANCES),
        noise=Noise(1e-4, 1e-4),
    ).problem(measurements)
    found = identify(problem)
    assert found.converged
    assert found.undetermined == ()
    assert found.geometry.largest_difference(truth) < 1e-5
    document = IdentificationResult.of(found).document(PARAMETERS)
    assert list(document["geometry"]) == ["base", "platform", "offset"]
    assert [entry["name"] for entry in document["parameters"]] == list(PARAMETERS.names)
    assert np.array(document["covariance"]).shape == (42, 42)


def test_its_frames_are_found_again(drawing: Geometry, truth: Geometry) -> None:
    change = FrameTransform(
        Rotation.from_rotvec([0.2, -0.3, 0.4]).as_matrix(),
        np.array([10.0, -20.0, 30.0]),
        Rotation.from_rotvec([-0.1, 0.2, 0.3]).as_matrix(),
    )
    own = PoseBatch.of(pose for _, _, pose in islice(poses(drawing, np.random.default_rng(2)), 20))
    taught = MECHANISM.change_frames(truth, change)
    chosen = choose_frames(MECHANISM, BRANCH, taught=taught, new=truth, poses=change.poses(own))
    assert chosen.found.all()
    assert chosen.displacement.position_largest_mm < 1e-8
    np.testing.assert_allclose(chosen.geometry.vector, taught.vector, atol=1e-8)


def test_the_config_of_a_second_mechanism_is_read_and_rewritten(
    tmp_path: Path, drawing: Geometry, truth: Geometry
) -> None:
    config = tmp_path / "robot.toml"
    lines = [f"{symbol} = {values}" for symbol, values in drawing.document().items()]
    config.write_text("\n".join(["[geometry]", *lines, ""]))
    kept = NativeToml(PARAMETERS)
    assert kept.read(config).geometry.largest_difference(drawing) == 0.0
    config.write_text(kept.rewrite(config.read_text(), truth))
    assert kept.read(config).geometry.largest_difference(truth) < 1e-6


def test_missing_keys_are_named_by_the_mechanisms_own_symbols(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[geometry]\noffset = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n")
    needed = r"needs base \(six rows of 3 numbers, mm\), platform \(.*\) and offset \(six numbers, mm\)"
    with pytest.raises(FileError, match=rf"has no base.*{needed}"):
        NativeToml(PARAMETERS).read(config)


def test_the_cell_file_has_the_keys_of_the_mechanism(drawing: Geometry) -> None:
    section = geometry_settings(PARAMETERS)
    assert list(section.model_fields) == ["base", "platform", "offset"]
    assert section.model_validate(drawing.document()).model_dump()["offset"] == tuple(drawing["offset"])
    assert list(tolerance_settings(PARAMETERS)().model_dump()) == [
        "base_mm",
        "platform_mm",
        "offset_mm",
        "ball_mm",
    ]


def test_display_names_of_its_parameters() -> None:
    assert CONVENTION.display_name("offset4") == "leg 4 offset"
    assert CONVENTION.display_name("platform1z") == "platform1/platform3/platform5 z"


RAILS = ParameterSet(
    (
        ParameterKind("r", ("a", "b"), "rail directions, rad", "every rail", unit=ParameterUnit.RAD),
        ParameterKind("l", (), "leg lengths, mm", "every leg", default_tolerance=7.0, is_positive=True),
    )
)
"""Another number of parameters a leg, in two units."""


def test_a_unit_has_its_own_decimals_and_no_tolerance_by_default(tmp_path: Path) -> None:
    drawn = Geometry.of(RAILS, {"r": np.zeros((6, 2)), "l": np.full(6, 600.0)})
    built = Geometry.of(RAILS, {"r": np.full((6, 2), 1.23456e-6), "l": np.full(6, 600.1234561)})
    config = tmp_path / "robot.toml"
    lines = [f"{symbol} = {values}" for symbol, values in drawn.document().items()]
    config.write_text("\n".join(["[geometry]", *lines, f"branch = {SIGNS}", ""]))
    config.write_text(NativeToml(RAILS).rewrite(config.read_text(), built))
    read = NativeToml(RAILS).read(config).geometry
    assert read["r"][2, 1] == 1.235e-6
    assert read["l"][0] == 600.123456
    assert tolerance_settings(RAILS).model_fields["r_rad"].is_required()
    assert not tolerance_settings(RAILS).model_fields["l_mm"].is_required()


def test_vectors_arrays_and_documents_have_consistent_order() -> None:
    numbers = np.arange(len(RAILS), dtype=float)
    assert len(RAILS) == 18
    assert RAILS.names[:3] == ("r1a", "r1b", "r2a")
    np.testing.assert_array_equal(RAILS.array(numbers, "l"), numbers[12:])
    np.testing.assert_array_equal(RAILS.vector(RAILS.document(numbers)), numbers)
    of_legs = np.array([[f"r{leg}a", f"r{leg}b", f"l{leg}"] for leg in range(1, 7)]).ravel()
    assert tuple(of_legs[RAILS.leg_order]) == RAILS.names
    np.testing.assert_array_equal(
        RAILS.of_every_leg(np.array([1.0, 2.0, 3.0]))[[0, 1, 2, 12]], [1, 2, 1, 3]
    )


def test_the_balls_offset_needs_three_coordinates() -> None:
    with pytest.raises(ValueError, match="x, y, z"):
        ParameterKind("B", ("u", "v"), "joints", "every joint", has_ball_offset=True)
