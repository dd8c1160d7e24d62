"""Scatter that an identification shows, perhaps by chance, counts if the held-out records have it too."""

from dataclasses import replace

import pytest

from hexacell.identification.estimator import identify
from hexacell.results.written_geometry import as_written
from hexacell.robot.model import robot_of
from hexacell.uncertainty.effect_kinds import with_measured_stops
from hexacell.verdict.decision import Verdict
from hexacell.verdict.scatter_evidence import JudgedResult, verify_with_scatter
from hexacell.verdict.verification import HeldOut, verify
from tests.hexacell.altered_records import later
from tests.hexacell.conftest import visits

NOISE_MM = 0.01
FAR, NEAR = [(3.0, 2.0, -1.0), (2.0, 2.0, 2.0)], [(0.010, 0.002, -0.004), (0.003, 0.012, 0.002)]


@pytest.fixture(scope="module")
def without(bundled_cell, visit):
    """A result with the stated noise alone."""
    robot = robot_of(bundled_cell)
    found = identify(robot.problem(visit(seed=2).measured(NOISE_MM, 1)))
    written = as_written(bundled_cell.settings, robot, found.geometry).geometry
    return JudgedResult(robot.with_controller(written), found)


@pytest.fixture(scope="module")
def scattered(without):
    """The same with stops that no encoder sees, for which U is above the limit."""
    effects = with_measured_stops(without.robot.effects, 200.0, 5.0, 18.0)
    return without._replace(robot=replace(without.robot, effects=effects))


def held_out(noise: float) -> HeldOut:
    """Three held-out points of six poses, with so many times the noise that is stated."""
    exact = visits(points=3, orientations=6, seed=7).measured(noise * NOISE_MM, 3)
    return HeldOut(later(exact), FAR, NEAR)


def test_scatter_that_the_held_out_records_deny_does_not_count(bundled_cell, without, scattered) -> None:
    settings, records = bundled_cell.settings, held_out(1.0)
    assert verify(settings, scattered.robot, scattered.found, records).verdict is Verdict.NOT_EVALUATED
    verified = verify_with_scatter(settings, scattered, lambda: without, records)
    plain = verify(settings, without.robot, without.found, records)
    assert (verified.verdict, verified.accuracy) == (Verdict.PASS, plain.accuracy)
    assert "the held-out records do not confirm" in verified.tests[-1].sentence


@pytest.mark.parametrize("noise", [1.4, 5.0])
def test_scatter_that_they_confirm_counts(bundled_cell, without, scattered, noise) -> None:
    settings, records = bundled_cell.settings, held_out(noise)
    assert all(test.passed for test in verify(settings, without.robot, without.found, records).tests) == (
        noise < 2.0
    )
    verified = verify_with_scatter(settings, scattered, lambda: without, records)
    assert verified == verify(settings, scattered.robot, scattered.found, records)


def test_scatter_beyond_chance_counts_whatever_they_say(bundled_cell, scattered) -> None:
    settings, records = bundled_cell.settings, held_out(1.0)
    verified = verify_with_scatter(settings, scattered, lambda: scattered, records)
    assert verified == verify(settings, scattered.robot, scattered.found, records)


def test_a_result_that_passes_with_the_scatter_is_not_verified_again(bundled_cell, without) -> None:
    records = held_out(1.0)
    verified = verify_with_scatter(bundled_cell.settings, without, pytest.fail, records)
    assert verified.verdict is Verdict.PASS
