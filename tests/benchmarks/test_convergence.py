"""From the drawing to the robot, whatever its errors within +-7 mm are."""

from __future__ import annotations

import numpy as np

from hexacell.errors import LimitError
from hexacell.identification.estimator import identify
from hexacell.robot.virtual_robot import random_robot
from tests.benchmarks.figures import NEVER
from tests.benchmarks.samples import sample
from tests.records_within_travel import within_travel

ROBOTS = sample(__name__, "ROBOTS")
SIGMAS = 6.0


def test_every_robot_is_found(table_one, figure) -> None:
    robot = table_one.robot
    unreachable, failed, wrong, short = 0, 0, 0, 0
    for seed in range(ROBOTS):
        random = np.random.default_rng(seed)
        truth = random_robot(robot.mechanism, robot.drawing, robot.tolerances, random)
        try:
            campaign = within_travel(robot, truth, table_one.points, 11, np.radians(30), random)
        except LimitError:
            unreachable += 1
            continue
        found = identify(robot.problem(campaign.measured(0.01, random)))
        error = np.abs(found.free - robot.mechanism.convention.free_parameters(truth))
        failed += not found.converged
        wrong += bool((error > SIGMAS * np.sqrt(np.diag(found.free_covariance))).any())
        short += found.records < len(campaign.joints)
    figure(f"of {ROBOTS} robots with +-7 mm errors: points out of reach, left out", unreachable)
    figure("  of the others did not converge from the drawing", failed, "", NEVER)
    figure("  farther than 6 sigma from the truth (a wrong mode)", wrong, "", NEVER)
    figure("  identified without one or two records next to a singularity", short)
