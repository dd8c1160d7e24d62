"""No geometry that a gate refuses enters a controller, and noise alone hardly ever counts as worse."""

import re
from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.diagnostics.geometry_change import largest_change
from hexacell.identification.diagnostics.tolerance_check import tolerance_violations
from hexacell.identification.problem.prior import Noise, Tolerances
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import Termination
from hexacell.identification.terms.term import Finding
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.lengths import shown
from hexacell.results.result import IdentificationResult
from hexacell.results.term_result import TermResult
from hexacell.robot.model import robot_of
from hexacell.verdict.acceptance_gates import gates, gates_of_run
from hexacell.verdict.verification import DeviationStatistics, is_worse
from tests.benchmarks.worlds.trials import unmet_gates

TOLERANCES = Tolerances({"S": 7.0, "B": 7.0, "l": 7.0})


@pytest.fixture
def judged(identified, paper):
    """The gates by name, of an identification that may be spoiled first."""

    def judge(
        found=identified.estimate,
        tolerances=TOLERANCES,
        largest_change_mm=15.0,
        before=paper.nominal,
        residuals=identified.goodness,
        expired=None,
    ):
        found_gates = gates(
            found,
            tolerance_violations(found, Hexaglide(), paper.nominal, tolerances),
            residuals=residuals,
            change_mm=largest_change(Hexaglide(), before, found.geometry, tolerances),
            largest_change_mm=largest_change_mm,
            expired=expired,
        )
        return {gate.name: gate for gate in found_gates}

    return judge


@pytest.fixture
def shifted(identified, paper):
    """The identification with some parameters at given distances from the drawing, mm."""

    def shift(**errors):
        vector = identified.geometry.vector.copy()
        for name, error in errors.items():
            row = HEXAGLIDE_PARAMETERS.names.index(name)
            vector[row] = paper.nominal.vector[row] + error
        return replace(identified.estimate, geometry=Geometry(HEXAGLIDE_PARAMETERS, vector))

    return shift


def test_a_good_identification_passes_every_gate(judged):
    assert {name: gate.passed for name, gate in judged().items()} == {
        "converged": True,
        "agrees with the noise": True,
        "within tolerance": True,
        "small change": True,
    }


def test_all_gates_but_one_may_be_overruled_by_a_person(judged):
    overruled = {name for name, gate in judged().items() if gate.needs_person}
    assert overruled == {"agrees with the noise", "within tolerance", "small change"}
    assert [name for name, gate in judged().items() if gate.needs_cell_name] == ["within tolerance"]
    far = judged(largest_change_mm=1e-6)
    named = [name for name, gate in far.items() if gate.needs_cell_name]
    assert named == ["within tolerance", "small change"], "above the change limit it is typed"


def test_a_solver_that_did_not_converge_fails_the_gate(judged, identified):
    gate = judged(replace(identified.estimate, termination=Termination.ITERATIONS))["converged"]
    assert not gate.passed
    assert gate.sentence == "The solver ended because the largest number of iterations was used."


def test_a_rod_far_outside_its_tolerance_is_named_with_its_sign(judged, shifted):
    """A good residual is no proof: a user of another machine found rods 13 mm too short."""
    gate = judged(shifted(l3=-13.0, S1y=30.0), largest_change_mm=100.0)["within tolerance"]
    assert not gate.passed
    assert "l3 (-13.000 mm)" in gate.sentence
    assert re.search(r"S1y \(\+\d\d\.\d+ mm\)", gate.sentence)


def test_the_ball_tolerance_does_not_apply_to_a_single_joint(judged, shifted):
    found = shifted(B4z=25.0)
    assert not judged(found, tolerances=replace(TOLERANCES, ball_mm=40.0))["within tolerance"].passed


def test_the_change_is_from_the_controllers_geometry(judged, identified, paper):
    change = largest_change(Hexaglide(), paper.nominal, identified.geometry, TOLERANCES)
    assert judged(largest_change_mm=change + 0.01)["small change"].passed
    gate = judged(largest_change_mm=5.0)["small change"]
    assert not gate.passed
    assert f"largest change is {shown(change)}" in gate.sentence
    assert judged(largest_change_mm=1.0, before=identified.geometry)["small change"].passed


def test_changes_of_a_precise_robot_are_shown_in_micrometres(identified):
    found = gates(
        identified.estimate, (), residuals=identified.goodness, change_mm=0.004, largest_change_mm=0.1
    )
    assert "largest change is 4.00 um" in found[-1].sentence


def test_statistics_are_of_distances_not_of_coordinates():
    spread = DeviationStatistics.of([[3.0, 4.0, 0.0], [0.0, 0.0, -1.0]])
    assert spread == DeviationStatistics(mean_mm=3.0, poses=2)


@pytest.mark.parametrize(
    ("residuals", "needs_person"),
    [
        (ChiSquareTest(400.0, 100.0), True),  # the noise does not explain them
        (ChiSquareTest(40_000.0, 100.0), False),  # they contradict the model: nobody may accept them
        (ChiSquareTest(0.0, 0.0), True),  # no redundancy
    ],
)
def test_residuals_that_do_not_agree_pass_no_gate(judged, residuals, needs_person):
    gate = judged(residuals=residuals)["agrees with the noise"]
    assert (gate.passed, gate.needs_person) == (False, needs_person)


LARGE = DeviationStatistics(3.41, 10)
SMALL = DeviationStatistics(0.010, 10)
NOISE = Noise(encoder=0.01, gauge_mm=0.01)


@pytest.mark.parametrize(
    ("before", "after", "worse"),
    [
        (LARGE, SMALL, False),
        (SMALL, LARGE, True),
        (SMALL, SMALL, False),
        (SMALL, DeviationStatistics(0.04, 10), False),  # a difference that noise explains
        (SMALL, DeviationStatistics(0.10, 10), True),
    ],
)
def test_worse_means_significantly_worse(before, after, worse):
    assert is_worse(before, after, NOISE) is worse


def noisy(random, points):
    """Deviations of a robot that returns exactly, with the noise of records and of their references."""
    readings = 0.014 * random.standard_normal((points, 13, 3))
    return DeviationStatistics.of(readings[:, 1:] - readings[:, :1], points)


@pytest.mark.parametrize("points", [1, 3])
def test_noise_alone_is_hardly_ever_worse(points):
    random = np.random.default_rng(5)
    worse = [is_worse(noisy(random, points), noisy(random, points), NOISE) for _ in range(2000)]
    assert sum(worse) <= 4


@pytest.mark.parametrize(
    "useless", [[], np.empty((0, 3)), *([[0.01, 0, 0], [0, one, 0]] for one in (np.nan, np.inf, -np.inf))]
)
def test_no_deviations_and_no_numbers_give_no_statistics(useless):
    assert DeviationStatistics.of(useless) is None


def test_an_expired_certificate_needs_a_person(judged):
    assert "certified" not in judged()
    assert judged(expired=())["certified"].passed
    gate = judged(expired=("gauge x", "encoders"))["certified"]
    assert (gate.passed, gate.needs_person, gate.needs_cell_name) == (False, True, False)
    assert gate.sentence == "The certificate has expired: gauge x, encoders."


def test_benchmarks_count_by_every_gate_of_a_run(bundled_cell, identified):
    robot, settings = robot_of(bundled_cell), bundled_cell.settings
    assert unmet_gates(settings, robot, identified) == ()
    below = TermResult(
        name="backlash", finding=Finding.TAKEN, log_factor=9.0, values=(-1.0,) * 6, sigma=(0.01,) * 6
    )
    result = IdentificationResult.of(identified).model_copy(update={"terms": (below,)})
    unmet = [gate.name for gate in gates_of_run(settings, robot, result, ["gauge x"]) if not gate.passed]
    assert unmet == ["physical", "certified"]
