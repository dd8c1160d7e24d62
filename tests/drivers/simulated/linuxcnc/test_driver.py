"""The driver and the simulated controller over a real socket: they must agree, faults included."""

import asyncio

import pytest

from drivers.controllers.linuxcnc.shell_protocol import Limits
from drivers.errors import MotionInterrupted, MoveRefused, PoseRefused
from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

ALL = frozenset(StartupAction)
MOVE_S = 0.1
TARGET = Pose(100.0, -200.0, 550.0, 12.5, -3.0, 8.0)
LONG_S = 30.0  # slow enough to be stopped on the way, quick enough to be seen moving


@pytest.fixture
async def ready(driver):
    """A driver that has prepared the machine."""
    made = driver()
    await made.open()
    await made.prepare(ALL)
    yield made
    await made.close()


async def test_a_stop_that_overtakes_its_move(ready, machine):
    """The abort may overtake the move that it is meant for."""
    machine.duration_s = LONG_S
    moving = asyncio.create_task(ready.move(TARGET, MOVE_S))
    await asyncio.sleep(0)
    await ready.stop()
    with pytest.raises(MotionInterrupted):
        await moving


async def test_an_unreachable_pose_while_another_client_waits_for_no_completion(ready, simulated):
    """``set_wait received`` is global in 2.9: NAK becomes ACK, and only the position tells."""
    simulated.state.waits = False
    with pytest.raises(PoseRefused, match="fails kinematicsInverse"):
        await ready.move(Pose(0.0, 0.0, 5000.0), MOVE_S)
    await ready.prepare(ALL)
    with pytest.raises(MoveRefused):
        await ready.move(Pose(0.0, 0.0, 5000.0), MOVE_S)


async def test_a_frozen_controller_and_one_that_was_ended_are_told_apart(driver, simulated) -> None:
    hasty = driver(Limits(answer=0.3, quick=0.3, stop=0.3))
    await hasty.open()
    await hasty.prepare(ALL)
    before = await hasty.status()
    simulated.set_frozen(on=True)
    assert await hasty.status() == before, "its server still answers"
    with pytest.raises(DeviceError, match="not be stopped: it is frozen: it is connected, but did not"):
        await hasty.stop()
    simulated.set_frozen(on=False)
    await hasty.stop()
    simulated.is_silent = True
    with pytest.raises(DeviceError, match="not be stopped: it is frozen: it accepts the connection but"):
        await hasty.stop()
    simulated.set_unplugged(on=True)
    with pytest.raises(DeviceError, match="could not be stopped: it closed the connection: it was ended"):
        await hasty.stop()
    await asyncio.to_thread(simulated.close)
    with pytest.raises(DeviceError, match="could not be stopped: it cannot be reached: Connection refused"):
        await hasty.stop()
    await hasty.close()
