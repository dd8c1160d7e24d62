"""What the real LinuxCNC adds for backlash is what simulated joints lose behind their encoders."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.interfaces import StartupAction
from drivers.simulated.followed_controller import FollowedController
from hexacell.cell.loader import load_cell
from hexacell.config.layout import ConfigLayout
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.linuxcnc.conftest import LinuxCNC, _running
from tests.linuxcnc_orders import joints_of
from tests.waiting import wait_until

LOST_MM = 0.1
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


async def test_joints_reach_the_same_place_from_either_side(
    compensating: LinuxCNC, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in compensating.environment.items():
        monkeypatch.setenv(name, value)
    cell = load_cell(compensating.folder / "cell.toml")
    settings, layout = cell.settings, ConfigLayout.of(cell.settings)
    assert settings.simulation is not None
    commanding = layout.read(*cell.config_paths)
    there = PoseBatch.of([THERE])
    joints = inverse_kinematics(settings.mechanism, commanding.geometry, commanding.branch, there)[0]
    controller = LinuxcncrshController(settings.controller)
    await controller.open()
    await controller.prepare(frozenset(StartupAction))
    arguments = (settings, settings.simulation, settings.mechanism, layout, cell.config_paths)
    with FollowedController(*arguments, other_processes=False) as simulated:
        physics = simulated.physics
        for way in (-30.0, 30.0):
            await controller.move(Pose(THERE.x + way, THERE.y, THERE.z), 0.5)
            await controller.move(THERE, 0.5)
            shown = joints - 0.5 * np.sign(way) * LOST_MM
            wait_until(lambda: np.abs(physics.encoder_positions() - shown).max() < 5e-3)  # noqa: B023
            assert physics._joints == pytest.approx(joints, abs=5e-3)
            assert await joints_of(controller) == pytest.approx(joints, abs=1e-4), "without what is added"
    await controller.close()
