"""The evidence for the model: tests of it, and how new records confirm a narrow failure or not.

Each test fails with a probability of 0.1 % although the model is right: of a cell that is calibrated
every night one run a year would fail. A failure that is not beyond chance is therefore to be
confirmed, as that of an experiment is, by new records alone: at poses that are unlike all before, predicted
from all other records. What made a test fail narrowly is in these too, and is found by a test at 1 %.
"""

from collections.abc import Sequence

import numpy as np

from hexacell.cell.fields import Frozen
from hexacell.identification.diagnostics.model_tests import leave_one_point_out, prediction_test
from hexacell.identification.solver.chi_square import SMALLEST_PROBABILITY, ChiSquareTest
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Mask

BEYOND_CHANCE = 1e-6
"""Probability below which a failure is beyond chance, and no confirming records are taken."""

CONFIRMING_PROBABILITY = 1e-2
"""Probability of confirming records so far off by chance: with the first test at most 1 in 100,000."""

HELD_OUT = "held-out records"
"""Name of the test of the held-out records."""

ZEROS_DOUBTED = "perhaps the controller ran other zeros than its config had; restart it and run again."
"""A cause that nothing shows before a result is written, where the controller reads the encoders: what
it reports of a joint, less a zero that it does not run, is wrong, and nothing contradicts it."""


class ModelTest(Frozen):
    """One test of the model, whether it holds, and that as a sentence for people.

    ``probability`` is that of such records by chance; None where the test has none.
    """

    name: str
    passed: bool
    sentence: str
    probability: float | None = None

    @property
    def failed_narrowly(self) -> bool:
        """Whether it failed in a way that chance may have caused."""
        return not self.passed and self.probability is not None and self.probability >= BEYOND_CHANCE


def model_tests(found: Identification, updated: Identification) -> tuple[ModelTest, ...]:
    """The tests of an identification; ``updated`` contains the held-out records as well."""
    points = leave_one_point_out(found)
    held_out = ~np.isin(updated.problem.labels[:, 0], found.problem.labels[:, 0])
    predicted = prediction_test(updated, held_out)
    is_predicted = predicted.probability >= SMALLEST_PROBABILITY
    return (
        _model_test("residuals", found.goodness, "The residuals", passed=found.goodness.is_explained),
        # Records that are too close to their prediction are no evidence against the model.
        _model_test(HELD_OUT, predicted, "The held-out records", passed=is_predicted),
        *(
            _model_test(
                f"point {point} from the others",
                test,
                f"The records of point {point}, predicted from the other points,",
                passed=test.probability >= SMALLEST_PROBABILITY / len(points),
            )
            for point, test in points.items()
        ),
    )


def with_zeros_doubted(tests: Sequence[ModelTest]) -> tuple[ModelTest, ...]:
    """The tests where held-out records may fail because the controller ran other zeros than its config."""
    return tuple(
        _with_sentence(one, ZEROS_DOUBTED) if one.name == HELD_OUT and not one.passed else one
        for one in tests
    )


def fails_narrowly(tests: Sequence[ModelTest]) -> bool:
    """Whether tests failed, each of them in a way that confirming records can distinguish from chance."""
    failed = [test for test in tests if not test.passed]
    return bool(failed) and all(test.failed_narrowly for test in failed)


def confirmed(tests: Sequence[ModelTest], updated: Identification, rows: Mask) -> tuple[ModelTest, ...]:
    """The tests once there are confirming records, the ``rows`` (n,) of an ``updated`` identification.

    Those that failed narrowly hold if the confirming records agree with the model.
    """
    what = "The confirming records, predicted from all others,"
    test = prediction_test(updated, rows)
    agrees = test.probability >= CONFIRMING_PROBABILITY
    confirming = _model_test("confirming records", test, what, passed=agrees)
    if not confirming.passed:
        return (*tests, confirming)
    by_chance = (
        _with_sentence(one, "new records do not confirm that.").model_copy(update={"passed": True})
        if one.failed_narrowly
        else one
        for one in tests
    )
    return (*by_chance, confirming)


def _with_sentence(test: ModelTest, further: str) -> ModelTest:
    return test.model_copy(update={"sentence": f"{test.sentence.rstrip('.')}; {further}"})


def _model_test(name: str, test: ChiSquareTest, what: str, *, passed: bool) -> ModelTest:
    sentence = f"{what} are {test.ratio:.1f} times as far off as the stated noise explains."
    if passed:
        sentence = f"{what} agree with the stated noise."
    elif test.expected < 0.5:
        sentence = f"{what} prove nothing: there are no more records than unknowns."
    return ModelTest(name=name, passed=passed, sentence=sentence, probability=test.probability)
