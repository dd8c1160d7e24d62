"""The examples of the documentation are controllers: the adapter's driver passes their tests."""

import asyncio
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivers import conformance
from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.link import Timeouts
from drivers.controllers.adapter.options import AdapterOptions
from drivers.interfaces import Controller, StartupAction
from drivers.simulated.linuxcnc.server import SimulatedController
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from tests.drivers.conformance.test_controllers import LinuxcncTwin, MachineInTime

EXAMPLES = Path(__file__).parents[4] / "configs" / "controller-adapter"
HASTY = Timeouts(connect=20.0, answer=4.0, closing=0.5)
FEW = Timeouts(connect=0.5)


def settings_of(**options: object) -> ControllerSettings:
    """The settings of a controller with these options."""
    found = ControllerSettings(config="machine.ini", protocol="adapter")
    return found.model_copy(update={"options": AdapterOptions.model_validate(options)})


class AdapterTwin(LinuxcncTwin):
    """The simulated LinuxCNC behind the program of the example."""

    def __init__(self, server: SimulatedController) -> None:
        super().__init__(server)
        command = (sys.executable, str(EXAMPLES / "robot.py"))
        self.settings = settings_of(command=command).model_copy(update={"port": server.port})


class TestAdapter(conformance.ControllerConformance):
    def driver(self, settings: ControllerSettings) -> Controller:
        return AdapterController(settings, timeouts=HASTY)

    @contextmanager
    def twin(self) -> Iterator[conformance.ControllerTwin]:
        with SimulatedController(MachineInTime(), ControllerSettings(config="machine.ini")) as server:
            yield AdapterTwin(server)


@pytest.fixture
def minimal() -> Iterator[str]:
    """The address of the example without help."""
    command = [sys.executable, str(EXAMPLES / "minimal.py"), "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield f"127.0.0.1:{process.stdout.readline().strip()}"
        process.kill()


async def test_the_example_without_help_is_a_controller_too(minimal: str) -> None:
    controller = AdapterController(settings_of(address=minimal), timeouts=HASTY)
    identity = await controller.open()
    await controller.prepare(frozenset(StartupAction))
    target = Pose(10.0, -190.0, 560.0, 5.0, 0.0, -5.0)
    await controller.move(target, 0.1)
    reported = await controller.position()
    await controller.close()
    assert identity.description == "a robot that remembers"
    assert reported is not None
    assert reported.pose == target


async def test_a_second_client_of_a_server_moves_nothing(minimal: str) -> None:
    first, second = (AdapterController(settings_of(address=minimal), timeouts=FEW) for _ in range(2))
    await first.open()
    with pytest.raises(DeviceError, match=f"controller {minimal}: is frozen: it did not answer 'hello'"):
        await second.open()
    await first.prepare(frozenset(StartupAction))
    await asyncio.gather(first.close(), second.close())


def test_the_examples_are_as_short_as_promised() -> None:
    for example in EXAMPLES.glob("*.py"):
        assert len(example.read_text().splitlines()) < 100
