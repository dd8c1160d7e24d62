"""LinuxCNC with its own screen, AXIS, on a virtual display, and linuxcncrsh beside it."""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.linuxcnc.restart import restart
from drivers.errors import MoveRefused
from drivers.interfaces import StartupAction
from hexacell.cell.loader import load_cell
from hexacell.kinematics.pose import Pose
from tests.linuxcnc.conftest import LOCK, LinuxCNC, configuration
from tests.linuxcnc_orders import pose_of
from tests.waiting import wait_until

ALL = frozenset(StartupAction)
THERE = Pose(40.0, -20.0, 560.0, 5.0, -4.0, 10.0)
OUT_OF_REACH = Pose(0.0, 0.0, 900.0)


@pytest.fixture
def display() -> Iterator[str]:
    if shutil.which("Xvfb") is None:
        pytest.skip("there is no virtual display here; install xvfb")
    with subprocess.Popen(["Xvfb", "-displayfd", "1"], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        yield f":{server.stdout.readline().strip()}"
        server.terminate()


class Machine:
    """LinuxCNC as hexacell starts it again, which it also does where it does not run."""

    def __init__(self, configured: LinuxCNC) -> None:
        self.ini, self.folder = configured.ini, configured.folder
        self.started: list[subprocess.Popen[bytes]] = []

    def restart(self) -> int:
        """Gives the process of AXIS."""
        self.started.append(restart(self.ini))
        wait_until(lambda: screen_of(self) is not None)
        found = screen_of(self)
        assert found is not None
        return found

    def end(self) -> None:
        """As a person does; AXIS may wait forever for a task that was ended together with it."""
        has_quit = subprocess.run(["axis-remote", "--quit"], check=False).returncode == 0
        for process in self.started:
            if not has_quit and process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
            process.wait()
        wait_until(lambda: not LOCK.exists())


@pytest.fixture
def machine(
    installed: None, folder_of_nobody: Path, display: str, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Machine]:
    configured = configuration("hexaglide", folder_of_nobody, "hexaglide-axis.ini")
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.chdir(configured.folder)
    for name, value in configured.environment.items():
        monkeypatch.setenv(name, value)
    made = Machine(configured)
    yield made
    made.end()


def screen_of(machine: Machine) -> int | None:
    """The process of AXIS, once it is there."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
        except OSError:
            continue
        if b"/usr/bin/axis" in words and f"{machine.ini}.expanded".encode() in words:
            return int(path.parent.name)
    return None


async def move_there(machine: Machine) -> None:
    driver = LinuxcncrshController(load_cell(machine.folder / "cell.toml").settings.controller)
    await driver.open()
    try:
        await driver.prepare(ALL)
        await driver.move(THERE, 1.0)
        assert (await pose_of(driver)).as_tuple() == pytest.approx(THERE.as_tuple(), abs=1e-3)
        with pytest.raises(MoveRefused):  # AXIS may have read the reason before the program asked
            await driver.move(OUT_OF_REACH, 1.0)
        assert (await pose_of(driver)).as_tuple() == pytest.approx(THERE.as_tuple(), abs=1e-3)
    finally:
        await driver.close()


async def test_the_program_commands_it_beside_its_screen_and_restarts_both(machine) -> None:
    first = machine.restart()
    await move_there(machine)
    assert machine.restart() != first
    machine.started[0].wait()  # no window keeps it
    await move_there(machine)
