"""Machines with backlash, play and compliance: identified and corrected they are as good as without.

The bundled robot, 5 x 11 records, other equations (:mod:`tests.benchmarks.worlds`). Poses are chosen for
what the machine has, as a run does that finds it. A controller corrects what was found, as the
identification has it; U and verdict are those of a run.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.uncertainty import BUNDLED_TERMS
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.identification.placement import Placement
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.corrections import NO_CORRECTIONS, CorrectionKind
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.results.term_result import corrections_for, term_results
from hexacell.robot.model import Robot
from hexacell.verdict.decision import Verdict
from tests.benchmarks.figures import NEVER, at_least, at_most, least_by_chance
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.worlds import budgets, trials
from tests.benchmarks.worlds.not_geometry import NEWTON, effect_of, terms_of
from tests.benchmarks.worlds.world import World

MACHINES = sample(__name__, "MACHINES")

CANDIDATES = 512
"""Orientations from which a pose is chosen: about as many as a run compares."""


@dataclass(frozen=True)
class Machine:
    """Sizes of what is not geometry: from side to side, mm, mm and um/N; it gets warmer by K an hour.

    ``at_most`` is the largest ratio of its error to that of a machine without. Its owner states the weight
    as ``stated_n``, and looks for some terms only.
    """

    backlash: float = 0.0
    play: float = 0.0
    compliance: float = 0.0
    at_most: float = 1.2
    warmer_k: float = 0.0
    stated_n: float = NEWTON
    looked_for: tuple[str, ...] = BUNDLED_TERMS

    def drawn(self, random: np.random.Generator) -> dict[str, Array]:
        """Coefficients of each joint or leg, which differ by 20 %."""
        sizes = {"backlash": self.backlash, "play": self.play, "compliance": self.compliance}
        return {name: size * (1.0 + 0.2 * random.standard_normal(6)) for name, size in sizes.items()}


MACHINES_OF_A_KIND = {
    "none of them": Machine(at_most=1.05),
    "play +-0.1 mm": Machine(play=0.2),
    "play +-0.02 mm": Machine(play=0.04),
    "backlash +-0.1 mm": Machine(backlash=0.2),
    "backlash +-0.02 mm": Machine(backlash=0.04),
    "compliance 0.3 um/N": Machine(compliance=0.3),
    "backlash, warmer by 3 K": Machine(backlash=0.2, warmer_k=3.0, at_most=1.4),
    "play and compliance": Machine(play=0.2, compliance=0.3, at_most=1.4),
    "all at a third": Machine(0.067, 0.067, 0.1, at_most=1.4),
    "compliance, 20 % too heavy as stated": Machine(compliance=0.3, stated_n=1.2 * NEWTON),
    "play and compliance, 20 % too light": Machine(0.0, 0.2, 0.3, at_most=1.4, stated_n=0.8 * NEWTON),
    "backlash, play alone looked for": Machine(backlash=0.2, at_most=np.inf, looked_for=("play",)),
    "play, backlash alone looked for": Machine(play=0.2, at_most=np.inf, looked_for=("backlash",)),
}


@dataclass(frozen=True)
class Outcome(trials.Stated):
    """What came of a machine: its true error, as stated, and which terms were taken.

    ``loaded_mm`` is the true error at those task poses at which it is known on which side each leg lies;
    ``unmet``: see :func:`.unmet_gates`.
    """

    true_mm: float = np.nan
    loaded_mm: float = np.nan
    value_mm: float = np.nan
    u_mm: float = np.nan
    verdict: Verdict | None = None
    taken: tuple[str, ...] = ()
    unmet: tuple[str, ...] = ()


def sent_further(
    robot: Robot, found: Identification, poses: PoseBatch, joints: Array, came: Array
) -> Array:
    """What a controller that corrects the found terms adds to its joints (n, 6), mm."""
    if found.terms is None:
        return np.zeros_like(joints)
    at = Placement(robot.mechanism, robot.commanding, poses, joints)
    errors = sum(term.leg_errors(at, came) * found.terms.of(term.name)[0] for term in found.terms.terms)
    return -at.as_joints(np.asarray(errors))


def is_loaded(robot: Robot, found: Identification, poses: PoseBatch) -> Array:
    """At which poses (n,) no leg may lie on either side of its play, by what was found."""
    if found.terms is None:
        return np.ones(len(poses), dtype=bool)
    joints = robot.mechanism.inverse(found.geometry, robot.branch, poses)
    at, terms = Placement(robot.mechanism, found.geometry, poses, joints), found.terms
    surely = np.ones(len(poses), dtype=bool)
    for term in terms.terms:
        if term.on_either_side is not None:
            surely &= ~term.on_either_side(at, np.ones_like(joints), terms.of(term.name)[0]).any(
                axis=(1, 2)
            )
    return surely


def carried_out(machine: Machine, number: int) -> Outcome:
    coefficients = machine.drawn(np.random.default_rng([38, number]))
    every = trials.settings(CANDIDATES, tuple(name for name, sizes in coefficients.items() if sizes.any()))
    own = every[number % len(every)]
    offered = terms_of(own.robot, newton=machine.stated_n)
    terms = tuple(term for term in offered if term.name in machine.looked_for)
    robot = replace(own.robot, effects=budgets.machine("precision"), terms=terms)
    world = World(robot, own.truth, effect_of(coefficients, machine.warmer_k), number)
    try:
        found = identify(robot.problem(world.records(own.commands, robot.commanding)))
        written = robot.with_controller(robot.for_controller(found.geometry))
        corrections, _ = corrections_for(term_results(found), own.cell.settings, list(CorrectionKind))
        after = replace(written, corrections=corrections or NO_CORRECTIONS)
        corrected = replace(world, robot=after, sent_further=partial(sent_further, after, found))
        hour = world.hours(own.commands, robot.commanding)
        says = trials.verified(trials.stated_limit(trials.LIMIT_MM), corrected, found, own, hour)
    except HexacellError:
        return Outcome()
    belief = after.belief(found)
    task = Task.of(own.cell.settings, after, belief).reachable(belief)
    errors = corrected.errors(found.geometry, task.poses, task.workspace, hour)
    at_loaded = np.linalg.norm(errors.once, axis=-1)[is_loaded(after, found, task.poses)]
    return Outcome(
        errors.largest_once_mm,
        float(at_loaded.max(initial=0.0)),
        *trials.figures_of(says.accuracy),
        says.verdict,
        () if found.terms is None else tuple(term.name for term in found.terms.terms),
        trials.unmet_gates(own.cell.settings, robot, found),
    )


@pytest.fixture(scope="module")
def perfect() -> list[Outcome]:
    return on_all_cores(partial(carried_out, Machine()), range(MACHINES))


@pytest.mark.parametrize("kind", MACHINES_OF_A_KIND)
def test_what_is_not_geometry_is_found_and_corrected(figure, perfect, kind: str) -> None:
    machine = MACHINES_OF_A_KIND[kind]
    is_perfect = kind == "none of them"
    every = perfect if is_perfect else on_all_cores(partial(carried_out, machine), range(MACHINES))
    known = [one for one in every if np.isfinite(one.true_mm)]
    median, of_none = (np.nanmedian([one.true_mm for one in some]) for some in (every, perfect))
    figure("error if what was found is corrected", median, "mm")
    figure("over that of a machine without", median / of_none, "", at_most(machine.at_most))
    at_loaded = np.nanmedian([one.loaded_mm for one in every])
    figure("the same at poses that load every leg surely", at_loaded / of_none, "")
    figure("identified and judged", len(known), f"of {MACHINES}", at_least(MACHINES))
    passes = sum(one.is_accepted for one in every)
    figure("passes", passes, f"of {MACHINES}")
    figure("a gate holds the write back", sum(bool(one.unmet) for one in every), f"of {MACHINES}")
    stated = [one for one in known if one.is_stated]
    figure("a test of the model fails", len(known) - len(stated), f"of {MACHINES}")
    covered = sum(abs(one.value_mm - one.true_mm) <= one.u_mm for one in stated)
    figure("U covers", covered, f"of {len(stated)}", at_least(least_by_chance(0.93, len(stated))))
    false = sum(one.verdict is Verdict.PASS and one.true_mm > trials.LIMIT_MM for one in known)
    figure("false passes", false, "", NEVER)
    if is_perfect:
        taken = sum(bool(one.taken) for one in every)
        figure("a term is taken", taken, f"of {MACHINES}", at_most(max(1.0, 0.01 * MACHINES)))
