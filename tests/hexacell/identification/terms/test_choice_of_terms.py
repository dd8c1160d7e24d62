"""Terms beside the geometry are taken where records show them, with the right coefficients, else not.

The machine is closed by the equations of the worlds, which owe nothing to the code under test.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.identification.terms.backlash import backlash
from hexacell.identification.terms.compliance import compliance
from hexacell.identification.terms.finding import Finding
from hexacell.identification.terms.play import play
from hexacell.identification.terms.term import ModelTerm
from hexacell.measurements.records import MeasurementSet
from tests.benchmarks.worlds import budgets, encoders, legs
from tests.benchmarks.worlds.campaigns import Setting, setting
from tests.benchmarks.worlds.effects import Effect, at_once
from tests.benchmarks.worlds.world import World

DOWN, CENTRE_MM, NEWTON = np.array([0.0, 0.0, -1.0]), np.array([5.0, -3.0, 20.0]), 100.0
Alteration = Callable[[MeasurementSet], MeasurementSet]
SIZES = np.array([0.1, 0.06, 0.09, 0.05, 0.08, 0.07])
"""mm of backlash or play, a hundredth of them um/N of compliance."""

EFFECTS = {
    "backlash": encoders.hysteresis(0.5 * SIZES),
    "play": legs.play(0.5 * SIZES, NEWTON * DOWN, CENTRE_MM),
    "compliance": legs.elastic(3e-3 * SIZES, NEWTON * DOWN, CENTRE_MM),
}
TRUE = {"backlash": SIZES, "play": SIZES, "compliance": 3.0 * SIZES}


@cache
def own() -> Setting:
    return setting(0)


def offered() -> tuple[ModelTerm, ...]:
    base = own().robot.mechanism.normalize_frames(own().robot.drawing)[1].base
    return (
        backlash(0.1),
        play(0.1, base @ DOWN, CENTRE_MM),
        compliance(0.3, NEWTON, base @ DOWN, CENTRE_MM),
    )


def identified(
    *effects: Effect, records: Alteration = lambda measured: measured
) -> tuple[Identification, float]:
    """The result, and the largest error at the task if what was found is corrected."""
    robot = replace(own().robot, effects=budgets.machine("precision"))
    world = World(robot, own().truth, at_once(*effects), 1)
    measured = records(world.records(own().commands, robot.commanding))
    found = identify(replace(robot.problem(measured), offered=offered()))
    left = []
    for name, effect in EFFECTS.items():
        rest = TRUE[name] * any(one is effect for one in effects)
        if found.terms is not None and name in taken(found):
            rest = rest - found.terms.of(name)[0]
        left.append(corrected(name, rest))
    world = replace(world, effect=at_once(*left))
    errors = world.errors(found.geometry, own().task.poses, own().task.workspace)
    return found, errors.largest_mm


def corrected(name: str, rest: np.ndarray) -> Effect:
    if name == "backlash":
        return encoders.hysteresis(0.5 * rest)
    if name == "play":
        return legs.play(0.5 * rest, NEWTON * DOWN, CENTRE_MM)
    return legs.elastic(1e-3 * rest, NEWTON * DOWN, CENTRE_MM)


def taken(found: Identification) -> set[str]:
    return {one.name for one in found.tried_terms if one.finding is Finding.TAKEN}


@pytest.fixture(scope="module")
def without() -> float:
    found, error_mm = identified()
    assert not taken(found)
    assert found.terms is None
    assert {one.name for one in found.tried_terms} == {*TRUE}
    return error_mm


@pytest.mark.parametrize(
    "names", [["backlash"], ["play"], ["compliance"], ["backlash", "play", "compliance"]]
)
def test_what_records_show_is_taken_and_its_correction_makes_a_perfect_machine(names, without):
    found, error_mm = identified(*(EFFECTS[name] for name in names))
    assert taken(found) == {*names}
    assert found.terms is not None
    assert found.goodness.is_explained
    for name in names:
        values, sigma = found.terms.of(name)
        assert (np.abs(values - TRUE[name]) < 4.0 * sigma).all(), name
        assert np.sqrt(np.mean((values - TRUE[name]) ** 2)) < 0.35 * np.sqrt(np.mean(TRUE[name] ** 2)), name
    assert error_mm < 1.6 * without


def test_unknown_directions_are_no_evidence_of_backlash():
    def forgotten(measured: MeasurementSet) -> MeasurementSet:
        return MeasurementSet(tuple(replace(one, directions=()) for one in measured.records))

    found, _ = identified(EFFECTS["backlash"], records=forgotten)
    assert "backlash" not in taken(found)
    assert "backlash" not in {one.name for one in found.tried_terms}


def test_a_gross_error_beside_play_is_named_and_play_is_taken_all_the_same():
    def slipped(measured: MeasurementSet) -> MeasurementSet:
        rows = list(measured.records)
        x, y, z = rows[20].deviation
        rows[20] = replace(rows[20], deviation=(x, y + 1.0, z))
        return MeasurementSet(tuple(rows))

    found, _ = identified(EFFECTS["play"], records=slipped)
    assert taken(found) == {"play"}
    assert [record for record, _ in found.left_out] == [found_id(20)]


def found_id(row: int) -> tuple[int, int]:
    point, orientation = own().commands.labels[row].tolist()
    return point, orientation


def test_covariances_of_geometry_and_terms_belong_together():
    found, _ = identified(EFFECTS["play"])
    assert found.terms is not None
    joint = found.terms.joint_covariance(found.free_covariance)
    assert np.linalg.eigvalsh(joint).min() > -1e-12 * np.abs(joint).max()
