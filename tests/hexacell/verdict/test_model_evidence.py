"""A narrow failure of a test of the model, confirmed by new records or not."""

import numpy as np
import pytest

from hexacell.identification.diagnostics.model_tests import update
from hexacell.identification.estimator import identify
from hexacell.robot.model import robot_of
from hexacell.verdict import model_evidence
from tests.hexacell.altered_records import later
from tests.hexacell.conftest import visits

NOISE_MM = 0.01
NOISIER_MM = 0.014
"""So much noise is found, but not beyond chance."""


@pytest.fixture(scope="module")
def robot(bundled_cell):
    return robot_of(bundled_cell)


@pytest.fixture(scope="module")
def found(robot, visit):
    return identify(robot.problem(visit(seed=2).measured(NOISE_MM, 1)))


def measure(noise_mm, after, seed):
    """Records of three held-out points with some noise, numbered after others."""
    return later(visits(points=3, orientations=8, seed=seed).measured(noise_mm, seed), after)


def evidence(robot, found, held_out, further):
    first = update(found, robot.problem(held_out))
    tests = model_evidence.model_tests(found, first)
    both = update(first, robot.problem(further))
    return tests, model_evidence.confirmed(tests, both, np.isin(both.problem.labels[:, 0], further.points))


def test_records_of_the_stated_noise_do_not_confirm_a_failure(robot, found):
    tests, after = evidence(robot, found, measure(NOISIER_MM, 5, 8), measure(NOISE_MM, 8, 11))
    assert model_evidence.fails_narrowly(tests)
    assert all(test.passed for test in after)
    (failed,) = [test for test in tests if not test.passed]
    (taken,) = [test for test in after if test.name == failed.name]
    assert taken.sentence == f"{failed.sentence[:-1]}; new records do not confirm that."
    assert taken.probability == failed.probability


def test_as_noisy_records_confirm_it(robot, found):
    tests, after = evidence(robot, found, measure(NOISIER_MM, 5, 8), measure(NOISIER_MM, 8, 11))
    assert model_evidence.fails_narrowly(tests)
    assert [test.passed for test in after] == [*(test.passed for test in tests), False]
    assert after[-1].probability is not None
    assert after[-1].probability < model_evidence.CONFIRMING_PROBABILITY


def test_what_is_beyond_chance_is_no_narrow_failure(robot, found):
    first = update(found, robot.problem(measure(3.0 * NOISE_MM, 5, 7)))
    tests = model_evidence.model_tests(found, first)
    (failed,) = [test for test in tests if not test.passed]
    assert failed.probability is not None
    assert failed.probability < model_evidence.BEYOND_CHANCE
    assert not model_evidence.fails_narrowly(tests)


def test_tests_that_hold_or_of_old_runs_do_not_fail_narrowly():
    holds = model_evidence.ModelTest(name="a", passed=True, sentence="A.", probability=0.5)
    old = model_evidence.ModelTest(name="b", passed=False, sentence="B.")
    narrow = model_evidence.ModelTest(name="c", passed=False, sentence="C.", probability=1e-4)
    assert not model_evidence.fails_narrowly([holds])
    assert not model_evidence.fails_narrowly([holds, old])
    assert not model_evidence.fails_narrowly([narrow, old])
    assert model_evidence.fails_narrowly([holds, narrow])
