"""What the real LinuxCNC adds for backlash is what simulated joints lose behind their encoders."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.interfaces import StartupAction
from drivers.simulated.followed_controller import FollowedController
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import load_cell
from hexacell.config.layout import ConfigLayout
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot.model import robot_of
from tests.benchmarks.worlds.frames import best_frames, moved
from tests.linuxcnc.conftest import LinuxCNC, _running
from tests.linuxcnc.test_calibration import RUN, require_passed
from tests.linuxcnc_orders import joints_of
from tests.waiting import wait_until

LOST_MM = 0.1
LIMIT_MM = 0.3
"""Of the cell."""

RESTART = '["hexacell-restart-linuxcnc", "hexaglide.ini"]'
INI_FILE = """\
[[controller.further_files]]
config = "hexaglide.ini"
config_format = "linuxcnc-ini"

"""
THERE = Pose(20.0, -10.0, 550.0)


def with_backlash(folder: Path) -> None:
    """In the joints and in the INI file, and no noise."""
    ini, cell = folder / "hexaglide.ini", folder / "cell.toml"
    ini.write_text(re.sub(r"(?m)^\[JOINT_\d\]$", rf"\g<0>\nBACKLASH = {LOST_MM}", ini.read_text()))
    quiet = cell.read_text().replace(
        "[simulation.encoders]\nnoise_mm = 0.01", "[simulation.encoders]\nnoise_mm = 0"
    )
    cell.write_text(f"{quiet}\n[simulation.joints]\nbacklash_mm = {LOST_MM}\n")


@pytest.fixture
def compensating(installed: None, folder_of_nobody: Path) -> Iterator[LinuxCNC]:
    yield from _running("hexaglide", folder_of_nobody, with_backlash)


async def test_joints_reach_the_same_place_from_either_side(compensating, monkeypatch):
    for name, value in compensating.environment.items():
        monkeypatch.setenv(name, value)
    cell = load_cell(compensating.folder / "cell.toml")
    settings, layout = cell.settings, ConfigLayout.of(cell.settings)
    commanding = layout.read(*cell.config_paths)
    there = PoseBatch.of([THERE])
    joints = inverse_kinematics(settings.mechanism, commanding.geometry, commanding.branch, there)[0]
    controller = LinuxcncrshController(settings.controller)
    await controller.open()
    await controller.prepare(frozenset(StartupAction))
    with FollowedController(settings, cell.config_paths) as simulated:
        physics = simulated.physics
        for way in (-30.0, 30.0):
            await controller.move(Pose(THERE.x + way, THERE.y, THERE.z), 0.5)
            await controller.move(THERE, 0.5)
            shown = joints - 0.5 * np.sign(way) * LOST_MM
            wait_until(lambda: np.abs(physics.encoder_positions() - shown).max() < 5e-3)  # noqa: B023
            assert physics._joints == pytest.approx(joints, abs=5e-3)
            assert await joints_of(controller) == pytest.approx(joints, abs=1e-4), "without what is added"
    await controller.close()


def lagging(folder: Path) -> None:
    """Joints with backlash, and a cell that may write the INI file, which takes a restart."""
    cell = folder / "cell.toml"
    text = cell.read_text()
    for old, new in (
        ('["hexacell-set-pins", "hexaglide.hal", "geometry.inc"]', RESTART),
        ("[controller.config_options]", f"{INI_FILE}[controller.config_options]"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    cell.write_text(f"{text}\n[simulation.joints]\nbacklash_mm = {LOST_MM}\n")


@pytest.fixture
def lagging_machine(installed: None, folder_of_nobody: Path) -> Iterator[LinuxCNC]:
    yield from _running("hexaglide", folder_of_nobody, lagging)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_backlash_is_identified_and_the_real_controller_corrects_it(lagging_machine: LinuxCNC) -> None:
    require_passed(lagging_machine, lagging_machine.hexacell(*RUN))
    robot = robot_of(load_cell(lagging_machine.folder / "cell.toml"))
    assert np.array(robot.corrections.backlash) == pytest.approx(LOST_MM, abs=0.3 * LOST_MM)
    assert true_error_mm(lagging_machine) < LIMIT_MM


def true_error_mm(machine: LinuxCNC) -> float:
    """The largest at the task poses in the best frames, by the geometry of the simulation."""
    cell = load_cell(machine.folder / "cell.toml")
    assert cell.settings.simulation is not None
    robot = robot_of(cell)
    built = Geometry.of(robot.mechanism.parameters, cell.settings.simulation.geometry.model_dump())
    truth = robot.mechanism.normalize_frames(built)[0]
    task = Task.of(cell.settings, robot, robot.belief())
    every = PoseBatch.joined([task.poses, task.workspace])
    reached, count = robot.commanded(truth).actual_poses(every).poses, len(task.poses)
    length_mm = float(np.linalg.norm(truth["B"], axis=-1).mean())
    best = best_frames(reached[count:], task.workspace, length_mm)
    off = moved(reached[:count], best).positions - task.poses.positions
    return float(np.linalg.norm(off, axis=-1).max())
