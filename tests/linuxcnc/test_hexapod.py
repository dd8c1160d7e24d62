"""The stock hexapod: its zeros are read when LinuxCNC starts; its motors stay where they are meanwhile."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.interfaces import StartupAction
from hexacell.cell.loader import load_cell
from hexacell.config.change import propose
from hexacell.config.layout import ConfigLayout, fingerprint
from hexacell.config.write_back import commit
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import inverse_kinematics, joint_zeros
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.linuxcnc.conftest import TWO_FILES, LinuxCNC
from tests.linuxcnc_orders import joints_of, pose_of
from tests.waiting import wait_until

ALL = frozenset(StartupAction)
THERE = Pose(40.0, -20.0, 790.0, 5.0, -4.0, 10.0)
LARGEST_MOVE_MM = 1e-3
SAMPLE = "while true; do stdbuf -oL halsampler 2>/dev/null; sleep 0.1; done"
"""It ends whenever LinuxCNC does; started again, it begins with the hundred samples before."""


class Motors:
    """Where they have been, a hundred times a second, also over a restart of LinuxCNC."""

    def __init__(self, samples: Path) -> None:
        self._samples = samples

    def places(self) -> list[list[float]]:
        """All so far, mm."""
        lines = self._samples.read_text().split("\n")[:-1]
        return [[float(word) for word in words] for line in lines if len(words := line.split()) == 6]

    def wait(self) -> None:
        """Until the present is among them."""
        count = len(self.places())
        wait_until(lambda: len(self.places()) > count + 100)


@pytest.fixture
def motors(hexapod: LinuxCNC, tmp_path: Path) -> Iterator[Motors]:
    found = Motors(tmp_path / "samples")
    with (tmp_path / "samples").open("wb") as output:
        sampling = subprocess.Popen(
            ["sh", "-c", SAMPLE], env=hexapod.environment, stdout=output, start_new_session=True
        )
    yield found
    os.killpg(sampling.pid, signal.SIGKILL)
    sampling.wait()


@pytest.fixture
def in_its_folder(hexapod: LinuxCNC, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the program is started there."""
    monkeypatch.chdir(hexapod.folder)
    for name, value in hexapod.environment.items():
        monkeypatch.setenv(name, value)


@pytest.mark.parametrize("hexapod", ["one file", TWO_FILES], indirect=True)
async def test_other_zeros_are_read_by_a_restart_in_which_no_motor_moves(hexapod, motors, in_its_folder):
    cell = load_cell(hexapod.folder / "cell.toml")
    paths, layout, mechanism = cell.config_paths, ConfigLayout.of(cell.settings), cell.settings.mechanism
    before = layout.read(*paths).geometry
    random = np.random.default_rng(16)
    after = Geometry(before.parameters, np.round(before.vector + random.uniform(-5.0, 5.0, 42), 6))
    driver = LinuxcncrshController(cell.settings.controller)
    await driver.open()
    try:
        await driver.prepare(ALL)
        await driver.move(THERE, 1.0)
        motors.wait()
        stood = len(motors.places()) - 1
        change = propose(paths, layout, after, fingerprint_at_start=fingerprint(*paths))
        commit(change, hexapod.folder / "backup")
        await driver.reload(ALL)
        motors.wait()
        pose, told = await pose_of(driver), await joints_of(driver)
    finally:
        await driver.close()
    places = np.array(motors.places()[stood:])
    assert np.abs(places - places[0]).max() <= LARGEST_MOVE_MM
    assert told == pytest.approx(places[-1] + joint_zeros(mechanism, after), abs=1e-5)
    own = inverse_kinematics(mechanism, after, (), PoseBatch.of([pose]))
    assert own[0] == pytest.approx(places[-1], abs=1e-4)
    assert pose.as_tuple() != pytest.approx(THERE.as_tuple(), abs=0.1)
