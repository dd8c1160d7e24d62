"""The watch over nights: false alarms of unchanged robots, how soon a step is found, and where.

The information of a calibration and of a night is that of Table 1's robot: 55 records, then a check of 16
(0.01 mm noise on joint variables and deviations). Each night's evidence is drawn with it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest

from hexacell.checks.change_alarm import machine_causes, machine_records
from hexacell.drift.drift_watch import DriftWatch, watch_runs
from hexacell.drift.run_evidence import CarriedPosterior, Causes, RunEvidence
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.kinematics.rotations import Array
from hexacell.robot.virtual_robot import VirtualRobot
from tests.benchmarks.figures import at_most
from tests.benchmarks.machines import calibrated, on_all_cores
from tests.benchmarks.samples import sample

CELLS = sample(__name__, "CELLS")
STEPS = sample(__name__, "STEPS")
YEARS, NIGHTS = 10, 3650
RECORDS = 16
BEFORE = (90, 365)
LONGEST = 200
ALLOWANCE = 12.0 / np.sqrt(STEPS)
"""Nights: one standard deviation of the median of so many steps."""


@dataclass(frozen=True, eq=False)
class Machine:
    """A robot's causes, and the information of its calibration and of a night."""

    causes: Causes
    calibration: Array
    night: Array

    def runs(
        self, random: np.random.Generator, nights: int, step: Array, after: int
    ) -> Iterator[RunEvidence]:
        """A calibration and nights of a robot at 0 that changes by a step after some of them."""
        yield drawn(self.calibration, np.zeros(len(step)), random)
        for number in range(nights):
            yield drawn(self.night, step if number >= after else np.zeros(len(step)), random)


def drawn(information: Array, state: Array, random: np.random.Generator) -> RunEvidence:
    """The evidence of a run of a robot at a state."""
    values, vectors = np.linalg.eigh(information)
    noise = vectors @ (np.sqrt(np.maximum(values, 0.0)) * random.standard_normal(len(state)))
    return RunEvidence(information, information @ state + noise)


@lru_cache
def machine() -> Machine:
    known = calibrated()
    check = known.check()
    assert check.before is not None
    robot = VirtualRobot(check.robot, check.robot.commanding, np.random.default_rng(1))
    campaign = VirtualCampaign(replace(check.plan, with_forecast=False, goal=None), robot)
    while len(campaign.measurements) < RECORDS:
        campaign.step()
    night = machine_records(check.robot, campaign.measurements, check.robot.free_parameters).evidence
    causes = machine_causes(check.robot, len(night.weighted))
    return Machine(causes, np.linalg.inv(check.before.covariance), night.information)


def false_alarms(seed: int) -> int:
    one, random = machine(), np.random.default_rng([9, seed])
    return len(watch_runs(one.runs(random, NIGHTS, np.zeros(one.causes.free), 0), one.causes)[0])


def one_sigma(before: int, cause: int) -> Array:
    """A step by one cause that shifts its innovation by one standard deviation after so many nights."""
    one = machine()
    posterior = CarriedPosterior.diffuse(one.causes.free, 0)
    for information in [one.calibration] + [one.night] * before:
        posterior = posterior.after(RunEvidence(information, np.zeros(len(information))))
    total = posterior.information
    direction = one.causes.by_state[cause]
    share = np.linalg.solve(total + one.night, total).T
    step: Array = direction / np.sqrt(direction @ share @ one.night @ direction)
    return step


def nights_to_alarm(job: tuple[int, int]) -> float:
    """Until a step of one sigma is noticed; infinite if an alarm came before it, or none after."""
    before, seed = job
    one, random = machine(), np.random.default_rng([10, before, seed])
    step = one_sigma(before, seed % len(one.causes.legs))
    watch = DriftWatch(one.causes)
    for number, run in enumerate(one.runs(random, before + LONGEST, step, before)):
        if watch.add(run):
            return float(number - before) if number > before else np.inf
    return np.inf


@pytest.fixture(autouse=True)
def _before_there_are_more_processes() -> None:
    machine()


def test_unchanged_cells_raise_few_alarms(figure):
    found = sum(on_all_cores(false_alarms, range(CELLS)))
    most = at_most(CELLS + 3.0 * np.sqrt(CELLS))
    figure(f"false alarms of all parameters in {CELLS * YEARS} cell-years", found, "", most)


@pytest.mark.parametrize("before", BEFORE)
def test_a_step_of_one_sigma_is_found(figure, before):
    found = on_all_cores(nights_to_alarm, [(before, seed) for seed in range(STEPS)])
    median, most = np.quantile(found, [0.5, 0.9], method="nearest")
    target = at_most(22 + ALLOWANCE) if before == max(BEFORE) else None
    figure(f"a step of one sigma after {before} nights: found after, median", median, "nights", target)
    figure("  after nine of ten", most, "nights")
