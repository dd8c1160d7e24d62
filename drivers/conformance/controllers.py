"""The tests that every controller's driver passes, against a twin of its controller and of a machine."""

import asyncio
import math
from abc import abstractmethod
from dataclasses import replace
from typing import Protocol

from drivers.conformance.suite import FAULTS, Suite, against_twin, failure, require_named
from drivers.controllers.poses import agree
from drivers.errors import MotionInterrupted, MoveRefused, StartupNotPermitted
from drivers.interfaces import Controller, StartupAction
from hexacell.cell.robot import ControllerSettings
from hexacell.cell.simulation import FaultKind
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

ALL = frozenset(StartupAction)
QUICK_S, LASTING_S, SLOW_S = 0.1, 0.5, 30.0
"""Durations of a move that is awaited, of one that is watched, and of one that is stopped on its way."""

EARLY = 0.9
"""Share of its duration after which a move may be over, by another clock."""

BEGUN = 20
"""So many times others get their turn before a preparation that has begun is cancelled."""


class ControllerTwin(Protocol):
    """A simulated controller that starts in emergency stop, and the machine behind it."""

    @property
    def settings(self) -> ControllerSettings:
        """The settings of the controller, with the address at which the twin answers."""

    @property
    def target(self) -> Pose:
        """A pose in reach, other than that in which it starts."""

    @property
    def out_of_reach(self) -> Pose:
        """A pose that it refuses."""

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Switch ``unplugged`` or ``silent`` on or off; ``emergency stop`` on."""


class ControllerConformance(Suite[Controller, ControllerTwin]):
    """Subclass it in a test file, name it ``Test...``, and say what is tested: docs/add-a-controller.md."""

    @abstractmethod
    def driver(self, settings: ControllerSettings) -> Controller:
        """The driver under test."""

    def _driver_of(self, twin: ControllerTwin) -> Controller:
        return self.driver(twin.settings)

    @against_twin
    async def test_it_does_what_is_permitted(self, controller: Controller, twin: ControllerTwin) -> None:
        await controller.open()
        assert isinstance(await failure(lambda: controller.prepare(frozenset())), StartupNotPermitted)
        assert not (await controller.status()).may_move
        await controller.prepare(ALL)
        assert (await controller.status()).may_move
        assert await controller.position() is not None

    @against_twin
    async def test_a_move_ends_at_its_pose(self, controller: Controller, twin: ControllerTwin) -> None:
        start = await self._ready(controller)
        for pose in (twin.target, start):
            await controller.move(pose, QUICK_S)
            assert await self._is_at(controller, twin, pose)

    @against_twin
    async def test_a_move_is_over_when_its_time_is(
        self, controller: Controller, twin: ControllerTwin
    ) -> None:
        await self._ready(controller)
        now = asyncio.get_running_loop().time
        began_s, moving = now(), asyncio.create_task(controller.move(twin.target, LASTING_S))
        while not moving.done():
            assert (await controller.status()).may_move
            await asyncio.sleep(0)
        await moving
        assert now() - began_s >= EARLY * LASTING_S
        assert await self._is_at(controller, twin, twin.target)

    @against_twin
    async def test_moves_come_one_after_another(self, controller: Controller, twin: ControllerTwin) -> None:
        start = await self._ready(controller)
        await asyncio.gather(*(controller.move(pose, QUICK_S) for pose in (twin.target, start)))
        assert await self._is_at(controller, twin, start)

    @against_twin
    async def test_nothing_moves_until_it_is_prepared(
        self, controller: Controller, twin: ControllerTwin
    ) -> None:
        name = (await controller.open()).name
        require_named(await failure(lambda: controller.move(twin.target, QUICK_S)), name)
        preparing = asyncio.create_task(controller.prepare(ALL))
        for _ in range(BEGUN):
            await asyncio.sleep(0)
        preparing.cancel()
        await asyncio.gather(preparing, return_exceptions=True)
        await controller.stop()
        if preparing.cancelled():
            require_named(await failure(lambda: controller.move(twin.target, QUICK_S)), name)
        await self._ready(controller)
        await controller.move(twin.target, QUICK_S)
        assert await self._is_at(controller, twin, twin.target)

    @against_twin
    async def test_no_number_is_refused(self, controller: Controller, twin: ControllerTwin) -> None:
        start = await self._ready(controller)
        for pose in (replace(twin.target, z=math.nan), replace(twin.target, a=math.inf)):
            refused = await failure(lambda pose=pose: controller.move(pose, QUICK_S))  # type: ignore[misc]
            assert isinstance(refused, MoveRefused), refused
        assert await self._is_at(controller, twin, start)
        await controller.move(twin.target, QUICK_S)

    @against_twin
    async def test_unreachable_pose_is_refused(self, controller: Controller, twin: ControllerTwin) -> None:
        start = await self._ready(controller)
        refused = await failure(lambda: controller.move(twin.out_of_reach, QUICK_S))
        assert isinstance(refused, MoveRefused), refused
        assert await self._is_at(controller, twin, start)
        await controller.move(twin.target, QUICK_S)

    @against_twin
    async def test_a_stop_ends_a_move_in_place(self, controller: Controller, twin: ControllerTwin) -> None:
        await self._ready(controller)
        moving = await self._begun(controller, twin)
        await controller.stop()
        [error] = await asyncio.gather(moving, return_exceptions=True)
        assert isinstance(error, MotionInterrupted), error
        await self._require_at_rest(controller, twin)
        await controller.move(twin.target, QUICK_S)

    @against_twin
    async def test_a_second_stop_is_harmless(self, controller: Controller, twin: ControllerTwin) -> None:
        start = await self._ready(controller)
        await controller.stop()
        assert await self._is_at(controller, twin, start)
        moving = await self._begun(controller, twin)
        await asyncio.gather(controller.stop(), controller.stop())
        await controller.stop()
        [error] = await asyncio.gather(moving, return_exceptions=True)
        assert isinstance(error, MotionInterrupted), error
        await self._require_at_rest(controller, twin)
        await controller.move(twin.target, QUICK_S)

    @against_twin
    async def test_a_stop_ends_what_waits(self, controller: Controller, twin: ControllerTwin) -> None:
        name = (await controller.open()).name
        start = await self._ready(controller)
        moving = await self._begun(controller, twin)
        waiting = asyncio.create_task(controller.move(start, QUICK_S))
        await asyncio.sleep(0)
        await controller.stop()
        for error in await asyncio.gather(moving, waiting, return_exceptions=True):
            require_named(error, name)
        await self._require_at_rest(controller, twin)

    @against_twin
    async def test_a_stop_finds_it_after_the_link_was_lost(
        self, controller: Controller, twin: ControllerTwin
    ) -> None:
        name = (await controller.open()).name
        await controller.prepare(ALL)
        moving = await self._begun(controller, twin)
        twin.inject("unplugged", on=True)
        [error] = await asyncio.gather(moving, return_exceptions=True)
        require_named(error, name)
        twin.inject("unplugged", on=False)
        await controller.stop()
        await self._ready(controller)
        await self._require_at_rest(controller, twin)
        await controller.move(twin.target, QUICK_S)

    @against_twin
    async def test_a_cancelled_move_is_stopped(self, controller: Controller, twin: ControllerTwin) -> None:
        await self._ready(controller)
        moving = await self._begun(controller, twin)
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
        await self._require_at_rest(controller, twin)

    @against_twin
    async def test_an_emergency_stop_ends_moves(self, controller: Controller, twin: ControllerTwin) -> None:
        name = (await controller.open()).name
        await controller.prepare(ALL)
        moving = await self._begun(controller, twin)
        twin.inject("emergency stop", on=True)
        [error] = await asyncio.gather(moving, return_exceptions=True)
        require_named(error, name)
        assert (await controller.status()).estop
        require_named(await failure(lambda: controller.move(twin.target, QUICK_S)), name)

    @against_twin
    async def test_a_later_emergency_stop_is_another(
        self, controller: Controller, twin: ControllerTwin
    ) -> None:
        await self._ready(controller)
        twin.inject("emergency stop", on=True)
        refused = await failure(lambda: controller.prepare(ALL - {StartupAction.RESET_ESTOP}))
        assert isinstance(refused, StartupNotPermitted), refused
        assert refused.needed is StartupAction.RESET_ESTOP
        await controller.prepare(ALL)
        await controller.move(twin.target, QUICK_S)

    @against_twin
    async def test_a_reload_moves_no_joint(self, controller: Controller, twin: ControllerTwin) -> None:
        await self._ready(controller)
        await controller.move(twin.target, QUICK_S)
        await controller.reload(frozenset())
        assert (await controller.status()).may_move
        assert await self._is_at(controller, twin, twin.target)

    @against_twin
    async def test_it_reopens_after_a_fault(self, controller: Controller, twin: ControllerTwin) -> None:
        for fault in FAULTS:
            name = (await controller.open()).name
            await controller.prepare(ALL)
            twin.inject(fault, on=True)
            for call in (controller.status, controller.position):
                require_named(await failure(call), name)
            require_named(await failure(lambda: controller.move(twin.target, QUICK_S)), name)
            twin.inject(fault, on=False)
            await controller.close()
            await self._ready(controller)
            await controller.move(twin.target, QUICK_S)
            assert await self._is_at(controller, twin, twin.target)

    @against_twin
    async def test_closing_twice_is_harmless(self, controller: Controller, twin: ControllerTwin) -> None:
        await controller.close()
        await self._ready(controller)
        await controller.close()
        await controller.close()
        for call in (controller.status, controller.position):
            assert isinstance(await failure(call), DeviceError)
        await self._ready(controller)
        await controller.move(twin.target, QUICK_S)

    async def _ready(self, controller: Controller) -> Pose:
        """Open and prepare it; where it stands."""
        await controller.open()
        await controller.prepare(ALL)
        return await self._pose(controller)

    async def _pose(self, controller: Controller) -> Pose:
        reported = await controller.position()
        assert reported is not None, "it is homed, and knows where the robot is"
        assert reported.joints is None or len(reported.joints) == 6
        return reported.pose

    async def _is_at(self, controller: Controller, twin: ControllerTwin, pose: Pose) -> bool:
        return agree(await self._pose(controller), pose, twin.settings)

    async def _begun(self, controller: Controller, twin: ControllerTwin) -> asyncio.Task[None]:
        """A slow move; it is on its way if the controller has a heartbeat that shows it."""
        before = (await controller.status()).heartbeat
        moving = asyncio.create_task(controller.move(twin.target, SLOW_S))
        await asyncio.sleep(0)
        while before and not moving.done():
            if (await controller.status()).heartbeat != before:
                break
        return moving

    async def _require_at_rest(self, controller: Controller, twin: ControllerTwin) -> None:
        once = await self._pose(controller)
        assert await self._is_at(controller, twin, once)
        assert not await self._is_at(controller, twin, twin.target)
