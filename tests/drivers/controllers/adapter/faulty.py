"""A driver before a program that fails, and what must hold whatever that does."""

import asyncio
import itertools
import sys
from pathlib import Path

from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.link import Timeouts
from drivers.controllers.adapter.options import Program
from drivers.errors import MoveRefused
from drivers.interfaces import StartupAction
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose
from tests.drivers.controllers.adapter.faulty_program import NAMES
from tests.waiting import until

PROGRAM = Path(__file__).with_name("faulty_program.py")
REQUESTS = (
    "hello",
    "status",
    "position",
    "reset-estop",
    "switch-on",
    "home",
    "move",
    "stop",
    "switch-off",
    "reload",
)
IMPATIENT = Timeouts(
    connect=5.0, answer=1.0, command=1.0, arrival=0.05, reload=1.0, beyond_move=0.7, stop=1.0, closing=0.5
)
ALL = frozenset(StartupAction)
TARGETS = (Pose(5.0, -195.0, 555.0, 3.0), Pose(0.0, -200.0, 550.0), Pose(2.0, -200.0, 550.0))


def driver(log: Path, fault: str = "", at: str = "", nth: int = 1) -> AdapterController:
    """The driver, before a program with a fault at the nth request of a kind; 0: at each."""
    settings = {"log": str(log), "fault": fault, "at": at, "nth": nth, "api_key": "sesame"}
    program = Program("controller faulty", (sys.executable, str(PROGRAM)), settings=settings)
    return AdapterController(ControllerSettings(config="machine.ini"), program, timeouts=IMPATIENT)


def done_by(log: Path) -> list[str]:
    """What the robot has done."""
    return log.read_text().split() if log.exists() else []


async def whole_job(controller: AdapterController, log: Path) -> DeviceError | None:
    """All that a run asks of a controller, until the first failure.

    Raises:
        AssertionError: it is not named, the robot still moves, or moves again without being prepared.
    """
    try:
        await controller.open()
        await controller.prepare(ALL)
        for target in TARGETS:
            await controller.move(target, 0.05)
            await controller.position()
        moving = asyncio.create_task(controller.move(TARGETS[0], 5.0))
        await until(lambda: done_by(log)[-1:] == ["move"] or moving.done())
        try:
            await controller.status()
            await controller.stop()
        finally:
            await asyncio.gather(moving, return_exceptions=True)
        await controller.move(TARGETS[1], 0.05)
        await controller.reload(frozenset())
        await controller.move(TARGETS[2], 0.05)
    except DeviceError as error:
        await _require_rest(controller, log, error)
        return error
    finally:
        await controller.close()
    return None


async def _require_rest(controller: AdapterController, log: Path, error: DeviceError) -> None:
    """It is named, and at rest, at the latest when it is told to stop, until it is prepared."""
    assert error.subject == "controller faulty", error
    assert "sesame" not in str(error)
    try:
        await controller.stop()
    except DeviceError:
        await controller.close()  # told to be the only way left
    done = done_by(log)
    # A program that was killed says nothing any more, and one after it is told to stop.
    assert done.count("move") - done.count("rest") <= 1
    is_only_refused = isinstance(error, MoveRefused)
    for target in TARGETS:
        try:
            await controller.move(target, 0.05)
        except DeviceError:
            continue
        assert is_only_refused, f"it moved after: {error}"
        break
    if not is_only_refused:
        assert done_by(log) == done, f"it moved after: {error}"


EVERY = tuple(itertools.product(NAMES, REQUESTS))
