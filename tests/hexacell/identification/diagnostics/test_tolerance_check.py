"""Robots built within their tolerances, and beyond: in any frames, with the ball anywhere allowed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexacell.identification.diagnostics.tolerance_check import tolerance_violations
from hexacell.identification.problem.prior import Tolerances
from hexacell.identification.solver.result import GeometryEstimate, Termination
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import FrameTransform
from hexacell.robot.virtual_robot import random_robot

MECHANISM = Hexaglide()
THREE_MM = Tolerances({"S": 3.0, "B": 3.0, "l": 3.0})
SEEDS = st.integers(0, 2**32 - 1)
TO_FLOOR = FrameTransform(
    rotations.from_vector([np.pi, 0.0, 0.0]), np.array([250.0, -80.0, 900.0]), np.eye(3)
)
"""Of a drawing whose base frame is on the floor, with z downwards."""


def estimate(geometry: Geometry, sigma: float = 0.0) -> GeometryEstimate:
    normal = MECHANISM.normalize_frames(geometry)[0]
    covariance = sigma**2 * np.eye(len(HEXAGLIDE_PARAMETERS))
    return GeometryEstimate(normal, covariance, Termination.STEP)


def names(found: GeometryEstimate, drawing: Geometry, tolerances: Tolerances) -> list[str]:
    return [one.name for one in tolerance_violations(found, MECHANISM, drawing, tolerances)]


def with_errors(drawing: Geometry, errors: dict[str, float], seed: int) -> Geometry:
    """A robot built within a third of 3 mm, but for some parameters."""
    vector = drawing.vector + np.random.default_rng(seed).uniform(-1.0, 1.0, len(drawing.vector))
    for name, error in errors.items():
        row = HEXAGLIDE_PARAMETERS.names.index(name)
        vector[row] = drawing.vector[row] + error
    return Geometry(HEXAGLIDE_PARAMETERS, vector)


@pytest.mark.parametrize("ball_mm", [0.0, 35.0])
@settings(max_examples=20)
@given(seed=SEEDS)
def test_no_robot_built_within_its_tolerances_is_refused(paper, ball_mm, seed):
    tolerances = replace(THREE_MM, ball_mm=ball_mm)
    built = random_robot(MECHANISM, paper.nominal, tolerances, np.random.default_rng(seed))
    assert names(estimate(built), paper.nominal, tolerances) == []


@settings(max_examples=15)
@given(seed=SEEDS)
def test_nor_one_whose_drawing_is_in_other_frames(paper, seed):
    drawing = MECHANISM.change_frames(paper.nominal, TO_FLOOR)
    built = random_robot(MECHANISM, drawing, THREE_MM, np.random.default_rng(seed))
    assert names(estimate(built), drawing, THREE_MM) == []


@settings(max_examples=20)  # each solves some thirty bounded least squares
@given(seed=SEEDS, sign=st.sampled_from([-1.0, 1.0]), leg=st.integers(1, 6))
def test_a_leg_beyond_its_tolerance_is_named_and_no_other_parameter(paper, seed, sign, leg):
    built = with_errors(paper.nominal, {f"l{leg}": sign * 3.5}, seed)
    [violation] = tolerance_violations(estimate(built), MECHANISM, paper.nominal, THREE_MM)
    assert violation.name == f"l{leg}"
    assert violation.change == pytest.approx(sign * 3.5)
    assert violation.tolerance == 3.0


@settings(max_examples=10)
@given(seed=SEEDS, name=st.sampled_from(["S1z", "S3y", "S6x", "B2y", "B4z", "B6x"]))
def test_a_joint_far_from_its_place_is_named(paper, seed, name):
    """Frames explain an error of one joint in part, those of three joints wholly."""
    built = with_errors(paper.nominal, {name: 25.0}, seed)
    assert name in names(estimate(built), paper.nominal, THREE_MM)


def test_the_ball_may_be_elsewhere_within_its_tolerance_and_an_excess_below_three_sigma_is_none(paper):
    offset = np.array([8.0, -5.0, 30.0]) @ HEXAGLIDE_PARAMETERS.ball_offset
    built = Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + offset)
    assert names(estimate(built), paper.nominal, replace(THREE_MM, ball_mm=30.0)) == []
    assert names(estimate(built), paper.nominal, replace(THREE_MM, ball_mm=20.0)) != []
    built = with_errors(paper.nominal, {"l3": 3.29}, seed=1)
    assert names(estimate(built, sigma=0.1), paper.nominal, THREE_MM) == []
    assert names(estimate(built, sigma=0.09), paper.nominal, THREE_MM) == ["l3"]


def test_robots_at_the_ends_of_their_tolerances_are_not_refused_for_the_noise_of_the_estimate(paper):
    """Every third number is as far out as allowed; one in a thousand may be called outside."""
    widths = THREE_MM.widths(HEXAGLIDE_PARAMETERS)
    refused = 0
    for seed in range(30):
        random = np.random.default_rng(seed)
        ends = random.choice([-1.0, 1.0], 42)
        errors = np.where(random.random(42) < 1.0 / 3.0, ends, random.uniform(-1.0, 1.0, 42))
        known = estimate(Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + widths * errors), sigma=0.3)
        free = MECHANISM.convention.basis @ random.normal(0.0, 0.3, 35)
        moved = Geometry(HEXAGLIDE_PARAMETERS, known.geometry.vector + free)
        refused += bool(names(replace(known, geometry=moved), paper.nominal, THREE_MM))
    assert refused == 0


def test_a_fault_is_seen_in_differences_that_are_known_well(paper):
    """Of lengths that are known to 5 mm, but for an error that they have in common."""
    lengths = np.array([name.startswith("l") for name in HEXAGLIDE_PARAMETERS.names], dtype=float)
    covariance = 5.0**2 * np.outer(lengths, lengths) + 0.05**2 * np.eye(42)
    built = with_errors(paper.nominal, {"l4": 9.0}, seed=3)
    found = replace(estimate(built), covariance=covariance)
    assert names(found, paper.nominal, THREE_MM) == ["l4"]
    healthy = with_errors(paper.nominal, {"l4": 2.9}, seed=3)
    assert names(replace(found, geometry=estimate(healthy).geometry), paper.nominal, THREE_MM) == []


def test_two_joints_that_are_out_are_both_named(paper):
    found = estimate(with_errors(paper.nominal, {"l2": 6.0, "B5x": -25.0}, seed=4))
    assert {"l2", "B5x"} <= set(names(found, paper.nominal, THREE_MM))


def test_joints_that_would_explain_it_as_well_are_named_beside(paper):
    """Two lengths of which the difference alone is known."""
    rows = [HEXAGLIDE_PARAMETERS.names.index(name) for name in ("l1", "l2")]
    common = np.zeros(42)
    common[rows] = 50.0
    drawn = paper.nominal.vector.copy()
    drawn[rows] += [7.0, -2.0]
    found = estimate(Geometry(HEXAGLIDE_PARAMETERS, drawn), sigma=0.05)
    found = replace(found, covariance=found.covariance + np.outer(common, common))
    [violation] = tolerance_violations(found, MECHANISM, paper.nominal, THREE_MM)
    assert {violation.name, "l1", "l2"} == {"l1", "l2"}
    assert violation.instead == (f"leg {3 - int(violation.name[1])} length",)


def test_an_estimate_that_is_not_a_number_is_outside(paper):
    broken = Geometry(HEXAGLIDE_PARAMETERS, np.full(42, np.nan))
    found = replace(estimate(paper.nominal), geometry=broken)
    assert len(names(found, paper.nominal, THREE_MM)) == 42
