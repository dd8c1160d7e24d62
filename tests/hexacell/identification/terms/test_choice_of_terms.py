"""Terms beside the geometry are taken where records show them, with the right coefficients, else not.

The machine is closed by the equations of the worlds, which owe nothing to the code under test.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hexacell.campaign.online_estimate import OnlineEstimator
from hexacell.identification.estimator import identify
from hexacell.identification.placement import Weight
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.result import Identification
from hexacell.identification.terms.compliance import compliance
from hexacell.identification.terms.term import Finding
from hexacell.kinematics.corrections import CorrectionKind
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.results.absorbed_terms import absorbing
from hexacell.results.term_result import corrections_for, impossible_terms, known_terms, term_results
from hexacell.robot.model import Robot
from hexacell.text.terms import terms_text
from hexacell.uncertainty.possible_causes import possible_causes
from tests.benchmarks.worlds import budgets
from tests.benchmarks.worlds.campaigns import Setting, setting
from tests.benchmarks.worlds.not_geometry import CENTRE_MM, NOTHING, effect_of, terms_of
from tests.benchmarks.worlds.world import World

SIZES = np.array([0.1, 0.06, 0.09, 0.05, 0.08, 0.07])
TRUE = {"backlash": SIZES, "play": SIZES, "compliance": 3.0 * SIZES}
"""mm, mm, um/N."""


@cache
def own() -> Setting:
    return setting(0)


@cache
def robot() -> Robot:
    drawn = own().robot
    return replace(drawn, effects=budgets.machine("precision"), terms=terms_of(drawn))


def world(names: tuple[str, ...]) -> World:
    return World(robot(), own().truth, effect_of({name: TRUE[name] for name in names}), 1)


@cache
def measured(*names: str) -> MeasurementSet:
    return world(names).records(own().commands, robot().commanding)


@cache
def identified(*names: str) -> Identification:
    return identify(robot().problem(measured(*names)))


def test_backlash_is_not_needed_where_all_stops_were_reached_from_one_side() -> None:
    one_sided = [replace(one, directions=(1,) * 6) for one in measured("play").records]
    backlash, play, _ = term_results(identify(robot().problem(MeasurementSet(tuple(one_sided)))))
    assert (backlash.finding, backlash.predicted, play.is_taken) == (Finding.ONE_SIDE, None, True)
    assert "backlash is not needed: it is the same" in " ".join(terms_text([backlash]).split())


def largest_mm(geometry: Geometry, left: Mapping[str, Array]) -> float:
    """The error at the task of a machine with so much left of what is not geometry."""
    errors = replace(world(()), effect=effect_of(left))
    return errors.errors(geometry, own().task.poses, own().task.workspace).largest_mm


def left_of(found: Identification, names: tuple[str, ...]) -> dict[str, Array]:
    """What is left if the controller corrects what was found."""
    results = {one.name: one.values or NOTHING for one in term_results(found)}
    return {name: TRUE[name] * (name in names) - results[name] for name in TRUE}


def taken(found: Identification) -> set[str]:
    return {one.name for one in found.tried_terms if one.finding is Finding.TAKEN}


@pytest.fixture(scope="module")
def without() -> float:
    found = identified()
    assert not taken(found)
    assert found.terms is None
    assert {one.name for one in found.tried_terms} == {*TRUE}
    return largest_mm(found.geometry, {})


@pytest.mark.parametrize("names", [("backlash",), ("play",), ("compliance",), tuple(TRUE)], ids=len)
def test_what_records_show_is_taken_and_its_correction_makes_a_perfect_machine(names, without):
    found = identified(*names)
    assert taken(found) == {*names}
    assert found.terms is not None
    assert found.goodness.is_explained
    for name in names:
        values, sigma = found.terms.of(name)
        assert (np.abs(values - TRUE[name]) < 4.0 * sigma).all(), name
        assert np.sqrt(np.mean((values - TRUE[name]) ** 2)) < 0.35 * np.sqrt(np.mean(TRUE[name] ** 2)), name
    assert largest_mm(found.geometry, left_of(found, names)) < 1.6 * without


def test_unknown_directions_are_no_evidence_of_backlash():
    forgotten = tuple(replace(one, directions=()) for one in measured("backlash").records)
    found = identify(robot().problem(MeasurementSet(forgotten)))
    assert "backlash" not in {one.name for one in found.tried_terms}


def test_sides_that_nobody_knows_of_joints_with_absurd_backlash_leave_weights_that_are_positive():
    found = identified("play")
    assert found.problem.terms is not None
    terms = replace(found.problem.terms, unknown=np.full((found.problem.records, 6), 0.0))
    terms.unknown[:, 5] = 1e12
    weights = predict(replace(found.problem, terms=terms), found.free, found.prediction.poses).weights
    assert (np.linalg.eigvalsh(weights) > 0.0).all()
    np.linalg.cholesky(weights)


def test_a_gross_error_beside_play_is_named_and_play_is_taken_all_the_same():
    rows = list(measured("play").records)
    x, y, z = rows[20].deviation
    rows[20] = replace(rows[20], deviation=(x, y + 1.0, z))
    found = identify(robot().problem(MeasurementSet(tuple(rows))))
    assert taken(found) == {"play"}
    assert [record for record, _ in found.left_out] == [rows[20].id]


def test_covariances_of_geometry_and_terms_belong_together():
    found = identified("play")
    assert found.terms is not None
    joint = found.terms.joint_covariance(found.free_covariance)
    assert np.linalg.eigvalsh(joint).min() > -1e-12 * np.abs(joint).max()


def test_while_measuring_the_terms_are_found_as_well():
    """Otherwise poses would be planned for a machine that goes half a millimetre elsewhere."""
    some = MeasurementSet(measured("compliance").records[:22])
    estimate = OnlineEstimator(robot()).estimate(some)
    assert estimate.identification is not None
    assert estimate.belief.terms is not None
    values, sigma = estimate.belief.terms.of("compliance")
    assert np.abs(values.mean() - TRUE["compliance"].mean()) < 4.0 * sigma.mean()
    poses, joints = estimate.identification.poses, estimate.identification.problem.joints
    assert np.abs(estimate.belief.beside(poses, joints)).max() > 0.1


def test_known_terms_let_no_others_be_looked_for_and_fewer_records_suffice():
    known = known_terms(robot().terms, term_results(identified("play", "compliance")))
    later = replace(robot(), known_terms=known)
    problem = later.problem(MeasurementSet(measured("play", "compliance").records[:33]))
    assert not problem.offered
    found = identify(problem)
    assert {one.finding for one in found.tried_terms} == {Finding.KNOWN}
    assert found.goodness.is_explained
    assert found.terms is not None
    for term in known:
        values, sigma = found.terms.of(term.name)
        assert (np.abs(values - TRUE[term.name]) < 4.0 * sigma).all()
        assert term.sigma is not None
        assert (sigma <= term.sigma).all(), "what was known is not forgotten"


def test_a_geometry_does_most_of_what_a_controller_cannot_correct(without):
    found = identified("compliance")
    corrections, left = corrections_for(term_results(found), own().cell.settings, ())
    assert corrections is None
    wrong_mm = largest_mm(found.geometry, {"compliance": TRUE["compliance"]})
    absorbed = absorbing(own().cell.settings, robot(), found.geometry, left)
    assert largest_mm(absorbed, {"compliance": TRUE["compliance"]}) < 0.4 * wrong_mm
    assert wrong_mm > 3.0 * without


def test_a_config_gets_what_it_has_a_place_for_and_no_negative_compliance():
    found, settings = term_results(identified(*TRUE)), own().cell.settings
    negative = tuple(
        one.model_copy(update={"values": (-0.01, *(one.values or ())[1:])})
        if one.name == "compliance"
        else one
        for one in found
    )
    corrections, left = corrections_for(negative, settings, list(CorrectionKind))
    assert corrections is not None
    assert not left
    assert corrections.compliance_um_n[0] == 0.0 < corrections.compliance_um_n[1]
    corrections, left = corrections_for(found, settings, [CorrectionKind.BACKLASH])
    assert corrections is not None
    assert {*left} == {"play", "compliance"}
    assert corrections.backlash == pytest.approx(SIZES, abs=0.05)
    assert not any(corrections.play_mm)


def test_coefficients_that_no_machine_has_are_named() -> None:
    """The weight is stated to pull upwards: legs would yield towards it."""
    found = identified("compliance")
    results = term_results(found)
    assert impossible_terms(robot().terms, results) == []
    base = robot().mechanism.normalize_frames(robot().drawing)[1].base
    upwards = compliance(0.3, 100.0, Weight(base @ np.array([0.0, 0.0, 1.0]), CENTRE_MM))
    wrong = identify(replace(robot(), terms=(upwards,)).problem(measured("compliance")))
    named = impossible_terms((upwards,), term_results(wrong))
    [sentence] = named
    assert sentence.startswith("compliance of -0.")
    assert re.search(r"\(leg \d(, \d){2,5}\), below zero; check where the weight acts", sentence)
    less = replace(upwards, size=1e-3 * upwards.size)
    [sentence] = impossible_terms((less,), results)
    assert re.search(r"\(leg \d(, \d){2,5}\), far beyond what \[model\] states", sentence)


@pytest.mark.parametrize("off_mm", [(0.0, 0.0, 0.0), (40.0, 0.0, 0.0), (0.0, -40.0, 0.0)])
def test_a_weight_that_acts_elsewhere_than_stated_is_named(off_mm: tuple[float, float, float]) -> None:
    """The sides of the legs are then others than those by the stated place."""
    offered = terms_of(own().robot, CENTRE_MM + off_mm)
    found = identify(replace(robot(), terms=offered).problem(measured("play")))
    named = [one.name for one in possible_causes(found) if "own_weight_centre_mm" in one.name]
    assert found.goodness.is_explained == (not any(off_mm)) == (not named)
    if named:
        axis = int(np.argmax(np.abs(off_mm)))
        says = [float(number) for number in re.findall(r"([-+]\d+) mm", named[0])]
        assert np.sign(says[axis]) == -np.sign(off_mm[axis])
        assert 15.0 < abs(says[axis]) < 60.0


def test_terms_that_cannot_be_told_apart_are_named_with_what_would_tell() -> None:
    """Each joint arrives from the side to which the force of its leg puts it; then from either."""
    backlash, play, _ = robot().terms
    little = replace(world(()), effect=effect_of({"play": 0.4 * SIZES}))
    either = little.records(own().commands, robot().commanding)
    placed = identify(replace(robot(), terms=()).problem(either)).placement
    sides = -np.sign(play.leg_errors(placed, placed.directions) * placed.derivatives.joints).astype(int)
    alike = [replace(one, directions=tuple(side)) for one, side in zip(either.records, sides, strict=True)]
    offered = replace(robot(), terms=(backlash, play))
    results = term_results(identify(offered.problem(MeasurementSet(tuple(alike)))))
    [one] = [one for one in results if one.finding is Finding.NOT_DISTINCT]
    assert {one.name, one.rival} == {"backlash", "play"}
    assert not any(result.is_taken for result in results)
    said = " ".join(terms_text([one]).split())
    assert "from both sides" in said
    assert "pull and push" in said
    assert taken(identify(offered.problem(either))) == {"play"}, "as was said"
