"""What may be wrong where residuals are too large: the cause that was simulated explains most of them."""

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.placement import Placement, Weight, leg_forces
from hexacell.identification.solver.chi_square import ChiSquareVerdict
from hexacell.uncertainty.effect_kinds import load_at_work, rail_waves
from hexacell.uncertainty.possible_causes import ExcessTest, possible_causes
from tests.hexacell.altered_records import altered

GAUGES = "the gauges (scale, alignment, drift of the zero) or an oval ball"
CLEARANCE = "clearance in the legs that changes sides with the load"


@pytest.fixture(scope="module")
def clean(noisy, make_problem):
    return identify(make_problem(noisy))


@pytest.fixture
def found_with(noisy, make_problem):
    """The identification of records whose joint variables and deviations are changed."""

    def identified(joints=0.0, deviations=0.0):
        joints, deviations = np.broadcast_to(joints, (55, 6)), np.broadcast_to(deviations, (55, 3))
        rows = {record.id: row for row, record in enumerate(noisy.records)}
        measured = altered(
            noisy,
            lambda r: {
                "joints": r.joints + joints[rows[r.id]],
                "deviation": r.deviation + deviations[rows[r.id]],
            },
        )
        found = identify(make_problem(measured), find_outliers=False)
        assert found.goodness.agreement is ChiSquareVerdict.TOO_LARGE
        return found

    return identified


@pytest.fixture(scope="module")
def placement(clean):
    return Placement(clean.problem.mechanism, clean.geometry, clean.poses, clean.problem.joints)


def moved_by(placement, effect, causes):
    """What the causes (k,) of an effect do to the ball (55, 3), mm."""
    return -(effect.on_poses(placement)[:, :3] @ causes)


def drawn(seed, sigma, *shape):
    return sigma * np.random.default_rng(seed).standard_normal(shape)


def grown(placement):
    return placement.by_constraints[:, :3] @ drawn(4, 0.1, 6)


def first(found):
    return possible_causes(found)[0].name


@pytest.mark.parametrize(
    ("name", "errors"),
    [
        ("errors of the encoders", lambda p, _: {"joints": drawn(1, 3e-3, 6) * p.joints}),
        (GAUGES, lambda _, deviations: {"deviations": deviations @ drawn(2, 0.01, 3, 3)}),
        (
            "guides that are not straight or parallel",
            lambda p, _: {"deviations": moved_by(p, rail_waves(1.0, 600.0), drawn(3, 40.0, 12))},
        ),
        (
            "legs that yield under the load",
            lambda p, _: {"deviations": moved_by(p, load_at_work(1.0, 1.0), np.array([5.0, -5.0, -40.0]))},
        ),
        (
            "a temperature that changed while measuring",
            lambda p, _: {"deviations": np.linspace(-0.5, 0.5, 55)[:, None] * grown(p)},
        ),
    ],
)
def test_what_was_simulated_is_named_first(found_with, placement, noisy, name, errors):
    deviations = np.array([record.deviation for record in noisy.records])
    assert first(found_with(**errors(placement, deviations))) == name


def test_clearance_that_changes_sides_with_the_load(found_with, placement):
    sides = np.sign(leg_forces(placement, Weight(np.array([0.0, 0.0, -1.0]))))
    assert (np.ptp(sides, axis=0) > 0.0).any()
    moved = placement.by_constraints[:, :3] @ (0.1 * sides)[..., None]
    assert first(found_with(deviations=moved[..., 0])) == CLEARANCE


@pytest.mark.parametrize(("leg", "row", "lost_mm"), [(2, 17, 0.1), (5, 40, 0.3)])
def test_an_encoder_that_lost_its_place(found_with, leg, row, lost_mm):
    joints = np.zeros((55, 6))
    joints[row:, leg] = lost_mm
    name = f"encoder {leg + 1} that lost its place before point {row // 11 + 1}, orientation "
    assert first(found_with(joints=joints)).startswith(name)


@pytest.mark.parametrize("seed", range(4))
def test_more_noise_is_not_explained_by_the_machine_and_no_encoder_lost_its_place(found_with, seed):
    random = np.random.default_rng(seed)
    causes = possible_causes(found_with(deviations=0.05 * random.standard_normal((55, 3))))
    assert all(cause.share < 0.4 for cause in causes)
    assert not [cause.name for cause in causes if "lost its place" in cause.name]


def test_a_false_reading_is_listed_with_its_record(found_with):
    deviations = np.zeros((55, 3))
    deviations[17, 1] = 0.4
    causes = possible_causes(found_with(deviations=deviations))
    assert causes[0].name == "a false reading at point 2, orientation 7"
    assert causes[0].share > 0.9
    assert [cause.share for cause in causes] == sorted((cause.share for cause in causes), reverse=True)


def test_the_share_of_unknowns_that_explain_no_more_than_chance_is_none(found_with):
    random = np.random.default_rng(6)
    test = ExcessTest(found_with(deviations=0.05 * random.standard_normal((55, 3))))
    goodness = test.found.goodness
    by_chance = 12 * goodness.chi2 / goodness.expected
    assert test.share_of_gain(by_chance, 12) == pytest.approx(0.0, abs=1e-9)
    assert test.share_of_gain(goodness.chi2 - goodness.expected, 0) == pytest.approx(1.0)


def test_the_gain_of_columns_is_what_the_records_without_the_cause_save(found_with, clean, placement):
    effect = load_at_work(1.0, 1.0)
    wrong = found_with(deviations=moved_by(placement, effect, np.array([0.0, 0.0, -20.0])))
    saved = wrong.goodness.chi2 - clean.goodness.chi2
    test = ExcessTest(wrong)
    assert test.share_of_gain(*test.gain(*test.by_effects(effect))) == pytest.approx(
        test.share_of_gain(saved, 3), abs=0.02
    )
