"""Zeros alone: what is held stays, its tolerance is its uncertainty, and poses err least."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.conformance import MechanismExample
from hexacell.conformance.frame_checks import records_without_noise
from hexacell.errors import IdentifiabilityError
from hexacell.identification.estimator import estimate_online, identify
from hexacell.identification.identified_zeros import (
    HeldParameters,
    IdentifiedZeros,
    ParameterChoice,
    zero_columns,
)
from hexacell.identification.problem.prior import Tolerances
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot, robot_of

CONFIGS = Path(__file__).parents[3] / "configs"
ZEROS = {"simulated-hexaglide": 5, "gough-stewart": 6, "linapod": 5, "rotary-cranks": 6}
SHIFT = np.array([0.7, -0.4, 0.3, -0.6, 0.5, 0.2])


def zeros_robot(name: str) -> tuple[Robot, MechanismExample]:
    """A cell's robot of which the zeros alone are identified, and where it is measured."""
    cell = load_cell(CONFIGS / f"{name}.toml")
    robot = replace(robot_of(cell), identifies=ParameterChoice.ZEROS)
    points = np.array(cell.settings.identification.points)
    return robot, MechanismExample(
        robot.mechanism, robot.drawing, robot.branch, points, robot.tolerances.by_kind
    )


@pytest.fixture(scope="module", params=ZEROS)
def named(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def with_zeros(robot: Robot, shift: np.ndarray) -> Geometry:
    drawn = robot.drawing
    return Geometry(drawn.parameters, drawn.vector + robot.mechanism.encoder_zeros(drawn) @ shift)


def test_a_common_shift_of_parallel_sliders_is_no_zero(named: str) -> None:
    """It is a shift of the base frame, which the rails' direction does not change."""
    robot, _ = zeros_robot(named)
    assert robot.unknowns == ZEROS[named]
    assert zero_columns(robot.mechanism, robot.drawing).shape[1] == ZEROS[named]
    assert replace(robot, identifies=ParameterChoice.ALL).unknowns == len(
        robot.mechanism.convention.free_names
    )


def test_zeros_that_are_wrong_are_found_and_nothing_else_changes(named: str) -> None:
    robot, example = zeros_robot(named)
    truth = with_zeros(robot, SHIFT)
    problem = robot.problem(records_without_noise(example, truth))
    zeros = robot.identified_zeros(identify(problem))
    assert zeros is not None
    written = robot.for_controller(zeros.geometry)
    changed = {
        name
        for name, change in zip(
            written.parameters.names, written.vector - robot.controller.vector, strict=True
        )
        if abs(change) > 1e-6
    }
    by_zeros = np.abs(robot.mechanism.encoder_zeros(robot.drawing)).max(axis=1)
    own = {written.parameters.names[row] for row in np.flatnonzero(by_zeros > 1e-9)}
    assert changed <= own
    expected = robot.mechanism.normalize_frames(truth)[0]
    assert zeros.geometry.largest_difference(expected) < 0.05


def test_what_is_held_has_its_tolerance_for_its_uncertainty(named: str) -> None:
    robot, example = zeros_robot(named)
    _, truth, *_ = example.robots()
    found = identify(robot.problem(records_without_noise(example, truth)))
    zeros = robot.identified_zeros(found)
    assert zeros is not None
    free = robot.mechanism.convention.free_names
    held = [row for row, name in enumerate(free) if name not in zeros.names]
    np.testing.assert_allclose(zeros.free[held], zeros.held[held], atol=1e-9)
    tolerances = np.sqrt(np.diag(robot.prior.covariance))[held]
    np.testing.assert_allclose(np.sqrt(np.diag(zeros.free_covariance))[held], tolerances, rtol=0.01)
    assert np.linalg.eigvalsh(zeros.free_covariance).min() > -1e-9


def test_the_stated_covariance_is_that_of_the_errors() -> None:
    """Over machines drawn as the tolerances say, each known as a Bayesian estimate leaves it."""
    robot, example = zeros_robot("gough-stewart")
    found = estimate_online(robot.problem(records_without_noise(example, robot.drawing)))
    prior, held = found.problem.prior, IdentifiedZeros.of(found, robot.controller)
    information = found.solution.information
    posterior = np.linalg.inv(information + prior.precision)
    gain = held.projector
    random, factor = np.random.default_rng(2), np.linalg.cholesky(prior.covariance)
    truths = factor @ random.standard_normal((len(factor), 4000))
    noise = np.linalg.cholesky(information + 1e-12 * np.eye(len(factor)) * np.trace(information))
    scores = information @ truths + noise @ random.standard_normal(truths.shape)
    errors = gain @ posterior @ scores - truths
    stated = HeldParameters(held.kept.columns, prior.covariance).covariance(gain, posterior)
    np.testing.assert_allclose(np.var(errors, axis=1), np.diag(stated), rtol=0.12)


def test_few_records_determine_zeros_and_not_all_parameters() -> None:
    """Where the other numbers are known: by their tolerances."""
    robot, example = zeros_robot("gough-stewart")
    robot = replace(robot, tolerances=Tolerances({"base": 0.01, "platform": 0.01, "offset": 2.0}))
    truth = with_zeros(robot, SHIFT)
    exact = records_without_noise(example, truth)
    few = MeasurementSet(tuple(one for one in exact.records if one.point <= 2 and one.orientation <= 4))
    zeros = robot.identified_zeros(identify(robot.problem(few)))
    assert zeros is not None
    assert zeros.undetermined == ()
    assert zeros.geometry.largest_difference(robot.mechanism.normalize_frames(truth)[0]) < 0.05
    every = replace(robot, identifies=ParameterChoice.ALL)
    with pytest.raises(IdentifiabilityError, match="18 equations for 33 parameters"):
        identify(every.problem(few))
    with pytest.raises(IdentifiabilityError, match="3 equations for 6 parameters"):
        identify(robot.problem(MeasurementSet(tuple(few.records[:2] + few.records[4:5]))))
