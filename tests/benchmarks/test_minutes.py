"""What a calibration takes of the machine's time, and what a minute buys beside fixed plans."""

import asyncio
import shutil
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np
import pytest

from hexacell.campaign.forecast import PlannedInformation
from hexacell.campaign.planner import Plan
from hexacell.campaign.time_model import TimeModel, seconds_beside
from hexacell.cell.loader import Cell, dump, load_cell
from hexacell.design.candidates import orientations
from hexacell.design.criteria import add_information
from hexacell.dry_run.campaign import VirtualCampaign, dry_run
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.durations import line_durations
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot, robots_within_tolerances
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.calibration_run import RunRequest, calibrate
from hexacell.text.time_spent import spent_text
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.journal.journal import read_entries
from procedures.journal.time_spent import time_spent
from tests.benchmarks.figures import at_most, between
from tests.benchmarks.machines import bundled, on_all_cores
from tests.benchmarks.samples import sample
from tests.small_cell import changed

ROBOTS, FIXED_PLANS = sample(__name__, "ROBOTS"), sample(__name__, "FIXED_PLANS")
CELLS = ("simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks")[
    : sample(__name__, "MECHANISMS")
]
CLOCK_FACTOR = 1.0 if len(CELLS) > 1 else 4.0
"""In real time the program counts as it does in a real cell; a run takes a quarter of an hour."""


def minutes_and_u(number: int) -> tuple[float, float] | None:
    """The minutes of a whole calibration of one robot of the bundled cell, and U by its identification."""
    cell = bundled()
    robot = robot_of(cell)
    plan = Plan(cell.settings, robot, with_forecast=False)
    truth = robots_within_tolerances(robot, number + 1, cell.settings.identification.seed)[number]
    random = np.random.default_rng([42, number])
    campaign = VirtualCampaign(plan, VirtualRobot(robot, truth, random))
    campaign.carry_out()
    plan = campaign.plan
    found = plan.estimate(campaign.state).of_records_alone()
    assert found is not None
    budget = plan.task.budget(found, plan.robot.belief(found), plan.robot.effects)
    assert budget is not None
    return campaign.minutes + sum(seconds_beside(cell.settings).values()) / 60.0, budget.expanded_mm


def test_a_calibration_of_the_bundled_cell(figure) -> None:
    minutes, u_mm = zip(*on_all_cores(minutes_and_u, range(ROBOTS)), strict=True)
    figure("minutes of a calibration, median", median(minutes), "", at_most(10.0))
    figure("U at the task by the identification, median", median(u_mm), "mm", at_most(0.105))


def fixed_plan_error(minutes: float, number: int) -> float:
    """The predicted error of the robot as drawn, by random poses in a short order, in this time."""
    cell = bundled()
    robot, settings = robot_of(cell), cell.settings
    belief, times = robot.belief(), TimeModel.of(settings)
    plan = Plan(settings, robot, with_forecast=False)
    balls = robot.from_commands([plan.reference_pose(point) for point in plan.points]).positions
    limits, random = robot.limits, np.random.default_rng([42, number])
    turns = orientations(256, limits.tilt * random.uniform(0.1, 1.0), number, most_twist=limits.turn)
    most = (minutes * 60.0 - len(balls) * times.station_s) / len(balls)
    sets = [in_time(belief, ball, random.permutation(turns), most, times) for ball in balls]
    information = PlannedInformation.of(sets, belief)
    parts = [information.information(point, len(poses)) for point, poses in enumerate(sets, start=1)]
    error = plan.task.error(belief)
    assert error is not None
    return error.worst(add_information(belief.joint_covariance, np.sum(parts, axis=0)))


def in_time(belief: RobotBelief, ball: Array, turns: Array, most_s: float, times: TimeModel) -> PoseBatch:
    """Poses at a point, each the nearest of a few, until the time there is used."""
    every = PoseBatch.at(ball, belief.limits.orientations(np.concatenate([np.eye(3)[None], turns])))
    joints = belief.commanded.joints(every)
    every = every[belief.limits.allow_joints(joints) & belief.limits.allow_commands(every)]
    taken, left, spent = [0], list(range(1, len(every))), 0.0
    robot = belief.mechanism, belief.controller, belief.branch
    while left:
        few = left[:4]
        ways = line_durations(*robot, every[[taken[-1]] * len(few)], every[few], times.speeds, 8)
        best = int(np.nanargmin(ways))
        spent += float(ways[best]) + times.overheads.move_s + times.reading_s
        if spent > most_s:
            break
        taken.append(few[best])
        left.remove(few[best])
    return every[taken]


def chosen_error(minutes: float) -> float:
    """The predicted error of the robot as drawn, by poses chosen for what they tell in a second."""
    cell = bundled()
    budget = minutes + sum(seconds_beside(cell.settings).values()) / 60.0
    settings = changed(cell.settings, {"identification.budget_minutes": budget})
    robot = robot_of(cell)
    plan = Plan(settings, robot, with_forecast=False)
    campaign = VirtualCampaign(plan, VirtualRobot(robot, robot.drawing, np.random.default_rng(42)))
    campaign.carry_out()
    assert campaign.minutes < 1.1 * minutes
    plan = campaign.plan
    worst = plan.forecaster.worst_error(campaign.state, plan.estimate(campaign.state).belief)
    assert worst is not None
    return worst


@pytest.mark.parametrize("minutes", [5.0, 8.0, 12.0])
def test_a_minute_buys_no_less_than_by_the_best_fixed_plan(figure, minutes: float) -> None:
    fixed = on_all_cores(partial(fixed_plan_error, minutes), range(FIXED_PLANS))
    ratio = chosen_error(minutes) / min(fixed)
    figure(
        f"{minutes:g} minutes: error over the best of {FIXED_PLANS} fixed plans", ratio, "", at_most(1.0)
    )


def slowly(cell: Cell, folder: Path, seed: int) -> Cell:
    """The cell in a folder, slow enough for its own devices."""
    shutil.copy(cell.config_path, folder)
    path = folder / cell.path.name
    path.write_text(
        dump(changed(cell.settings, {"timing.clock_factor": CLOCK_FACTOR, "simulation.seed": seed}))
    )
    return load_cell(path)


@pytest.mark.parametrize("name", CELLS)
def test_forecast_over_truth(figure, tmp_path: Path, name: str) -> None:
    cell = slowly(bundled(name), tmp_path, 1)
    forecast = dry_run(Plan(cell.settings, robot_of(cell)))
    run = RunFolder(runs_folder(cell) / "run")
    asyncio.run(calibrate(RunRequest(cell, run, Mode.OPTIMISE, UnattendedOperator(), unattended=True)))
    spent = time_spent(read_entries(run.journal), cell.settings.timing)
    figure(f"{name}: {spent_text(spent)}; forecast", forecast.minutes, "minutes")
    figure(
        f"{name}: forecast over truth",
        forecast.minutes * 60.0 / sum(spent.values()),
        "",
        between(0.9, 1.15),
    )
