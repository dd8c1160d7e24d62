"""A box that moves a hexapod, on the network: a line asks, a line answers, at once.

``MOVE x y z a b c s`` begins a motion, ``STATE`` answers with what holds of ``ESTOP ON HOMED MOVING``, and
``POSE`` with six numbers; what is refused is answered by ``NO`` and why.
"""

import asyncio
import math
from contextlib import suppress

from drivers.controllers.poses import agree
from drivers.errors import (
    ConnectionLost,
    MotionInterrupted,
    MoveRefused,
    ResponseTimeout,
    StartupNotPermitted,
)
from drivers.interfaces import (
    ControllerStatus,
    DeviceIdentity,
    ReportedPosition,
    StartupAction,
    StartupActions,
)
from drivers.wire_trace import TraceRecorder
from hexacell.cell.fields import Positive, Text, key
from hexacell.cell.robot import ControllerOptions, ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

COMMANDS = {
    StartupAction.RESET_INITIAL_ESTOP: "RESET",
    StartupAction.RESET_ESTOP: "RESET",
    StartupAction.SWITCH_ON: "ON",
    StartupAction.HOME: "HOME",
}


class BoxOptions(ControllerOptions):
    """``[controller.options]`` of the cell file."""

    robot: Text = key(..., "name of the robot in the box")
    answer_s: Positive = key(2.0, "longest wait for an answer, s")
    poll_s: Positive = key(0.05, "pause between two questions whether it still moves, s")


class HexapodBox:
    """Its driver. ``stop`` and ``status`` do not wait for an order: each answer comes at once."""

    Options = BoxOptions

    def __init__(self, settings: ControllerSettings, *, trace: TraceRecorder | None = None) -> None:
        del trace
        assert isinstance(settings.options, BoxOptions)
        self._settings, self._options = settings, settings.options
        self._name = f"controller {settings.host}:{settings.port}"
        self._order, self._asking = asyncio.Lock(), asyncio.Lock()
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._is_open = self._is_ready = self._was_on = False
        self._stops = 0

    async def open(self) -> DeviceIdentity:
        await self.close()
        self._is_open = True
        try:
            return DeviceIdentity(
                self._name, "hexapod-box", await self._ask(f"ROBOT {self._options.robot}")
            )
        except BaseException:
            await self.close()
            raise

    async def prepare(self, permitted: StartupActions) -> None:
        stops = self._stops
        async with self._order:
            await self._make_ready(permitted, stops)

    async def move(self, pose: Pose, duration_s: float) -> None:
        stops = self._stops
        async with self._order:
            if not all(map(math.isfinite, pose.as_tuple())):
                raise self._refused(pose, "a coordinate is no number")
            if not self._is_ready:
                raise self._refused(pose, "it is not prepared")
            if self._stops != stops:
                raise MotionInterrupted("was stopped before it moved", subject=self._name)
            numbers = " ".join(f"{number:.6f}" for number in (*pose.as_tuple(), duration_s))
            self._is_ready = False
            try:
                answer = await self._ask(f"MOVE {numbers}")
                await self._rest()
            except (asyncio.CancelledError, DeviceError) as error:
                with suppress(DeviceError):
                    await self.stop()
                    self._is_ready = isinstance(error, asyncio.CancelledError)
                raise
            there = await self._pose()
            self._is_ready = (
                answer.startswith("NO") or self._stops != stops or agree(there, pose, self._settings)
            )
            if answer.startswith("NO"):
                raise self._refused(pose, answer.removeprefix("NO "))
            if not agree(there, pose, self._settings):
                raise MotionInterrupted(f"stopped at {there} before reaching {pose}", subject=self._name)

    async def position(self) -> ReportedPosition | None:
        return ReportedPosition(await self._pose()) if "HOMED" in await self._state() else None

    async def status(self) -> ControllerStatus:
        state = await self._state()
        return ControllerStatus("ESTOP" in state, "ON" in state, heartbeat=await self._ask("POSE"))

    async def stop(self) -> None:
        self._stops += 1
        await self._ask("STOP")
        await self._rest()

    async def reload(self, permitted: StartupActions) -> None:
        stops = self._stops
        async with self._order:
            before, was_on = await self._pose(), "ON" in await self._state()
            self._is_ready = False
            await self._ask("OFF")
            await self._ask("RELOAD")
            await self._make_ready(permitted | ({StartupAction.SWITCH_ON} if was_on else set()), stops)
            if not agree(before, await self._pose(), self._settings):
                self._is_ready = False
                raise DeviceError("moved while it was off", subject=self._name, action="Look at it")

    async def close(self) -> None:
        self._is_open = self._is_ready = False
        self._hang_up()

    async def _make_ready(self, permitted: StartupActions, stops: int) -> None:
        self._is_ready = False
        while (action := self._needed(await self._state())) is not None:
            if action not in permitted:
                raise StartupNotPermitted(action, self._name)
            if self._stops != stops:
                raise MotionInterrupted("was stopped before it was ready", subject=self._name)
            permitted -= {action}  # what has no effect is not tried again
            await self._ask(COMMANDS[action])
            await self._rest()
        self._is_ready = self._was_on = True

    def _needed(self, state: frozenset[str]) -> StartupAction | None:
        if "ESTOP" in state:
            return StartupAction.RESET_ESTOP if self._was_on else StartupAction.RESET_INITIAL_ESTOP
        if "ON" not in state:
            return StartupAction.SWITCH_ON
        return None if "HOMED" in state else StartupAction.HOME

    async def _rest(self) -> None:
        while "MOVING" in await self._state():  # noqa: ASYNC110 - it tells nobody by itself
            await asyncio.sleep(self._options.poll_s)

    async def _state(self) -> frozenset[str]:
        return frozenset((await self._ask("STATE")).split())

    async def _pose(self) -> Pose:
        return Pose(*map(float, (await self._ask("POSE")).split()))

    def _refused(self, pose: Pose, reason: str) -> MoveRefused:
        return MoveRefused(
            f"to move to {pose}", reason, subject=self._name, action="Prepare it, then go on"
        )

    async def _ask(self, line: str) -> str:
        """The answer; over another connection where the last one was lost, or was not waited for."""
        if not self._is_open:
            raise DeviceError("is not connected", subject=self._name, action="Open it first")
        try:
            async with self._asking, asyncio.timeout(self._options.answer_s):
                if self._streams is None:
                    self._streams = await asyncio.open_connection(self._settings.host, self._settings.port)
                self._streams[1].write(f"{line}\n".encode())
                return (await self._streams[0].readuntil()).decode("ascii").strip()
        except BaseException as error:  # an answer that comes later must not be taken for another one
            self._hang_up()
            if isinstance(error, TimeoutError):
                raise ResponseTimeout("is frozen", subject=self._name, action="Look at the box") from error
            if isinstance(error, OSError | EOFError):
                raise ConnectionLost(
                    f"is lost: {error}", subject=self._name, action="Look at it"
                ) from error
            raise

    def _hang_up(self) -> None:
        streams, self._streams = self._streams, None
        if streams is not None:
            streams[1].close()
