"""A LinuxCNC machine driven through its network shell, linuxcncrsh, as its owner configured it."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import PurePath

from drivers.controllers import reload_command
from drivers.controllers.errors import (
    CommandRefused,
    ConnectionLost,
    MotionInterrupted,
    MoveRefused,
    ResponseTimeout,
)
from drivers.controllers.linuxcnc import startup as readiness
from drivers.controllers.linuxcnc.commands import ControllerCommands
from drivers.controllers.linuxcnc.protocol import pose_difference, rapid_move
from drivers.controllers.linuxcnc.session import Session
from drivers.controllers.linuxcnc.settings import Address, Timeouts
from drivers.interfaces import ControllerStatus, DeviceIdentity
from drivers.wire_trace import TraceRecorder
from hexacell.cell.devices import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

_PATIENCE = Timeouts()


class LinuxcncrshController:
    """``drivers.interfaces.Controller`` over TCP.

    Orders wait for their turn; ``stop`` and ``close`` do not. A connection that broke is opened
    anew by the next order, but a controller that was restarted must be prepared again, and so must
    one whose control another client took.
    """

    def __init__(
        self,
        settings: ControllerSettings,
        *,
        trace: TraceRecorder | None = None,
        patience: Timeouts = _PATIENCE,
    ) -> None:
        address = Address.of(settings)
        self._name = address.name
        self._settings = settings
        self._patience = patience
        self._session = Session(address, patience, trace)
        self._turn = asyncio.Lock()

    async def open(self) -> DeviceIdentity:
        """Connect and take control; nothing moves.

        Raises:
            DeviceError: Nothing, something else or a mute server is there, or a password is wrong.
        """
        async with self._turn:
            commands = await self._session.open()
            config = PurePath(await commands.get_if_known("inifile")).name
            return DeviceIdentity(
                name=self._name,
                protocol="linuxcncrsh",
                description=", ".join(filter(None, (commands.connection.server, config))),
            )

    async def prepare(self) -> None:
        """Leave emergency stop, switch on, home what is not homed, enter MDI. May move the machine.

        Raises:
            MotionInterrupted: ``stop`` was called meanwhile.
            DeviceError: A step has no effect; or units, offsets or modes would falsify coordinates.
        """
        stops = self._session.stop_count
        async with self._turn:
            commands = await self._session.in_control()
            await commands.errors()
            await readiness.acknowledge_on_completion(commands)
            await readiness.leave_emergency_stop(commands, self._patience)
            await readiness.switch_machine(commands, self._patience, on=True)
            await self._home_if_needed(commands, stops)
            await readiness.enter_mdi_mode(commands, self._patience)
            await readiness.check_coordinate_system(commands)

    async def move(self, pose: Pose) -> None:
        """Go to ``pose`` and return once the controller's own position agrees with it.

        When this is cancelled, or takes longer than ``move_timeout_s``, the machine is stopped.

        Raises:
            MoveRefused: Out of reach or of limits, or the controller is not prepared.
            MotionInterrupted: It stopped elsewhere; the message says where.
            DeviceError: The line broke.
        """
        stops = self._session.stop_count
        block = self._rapid_move(pose)
        async with self._turn:
            commands = await self._session.synchronized()
            if self._was_stopped_since(stops):
                raise MotionInterrupted("was stopped before it moved", subject=self._name)
            await self._travel(commands, block, pose)
            await self._expect_at(commands, pose, stops)

    async def pose(self) -> Pose:
        """The pose the controller believes the platform to have, mm and deg."""
        async with self._turn:
            return await (await self._session.synchronized()).pose()

    async def joint_positions(self) -> tuple[float, ...]:
        """The six joints as the controller has them, mm."""
        async with self._turn:
            return await (await self._session.synchronized()).joints()

    async def status(self) -> ControllerStatus:
        """Whether it is in emergency stop, whether it is on, and why not; also while ``move`` waits."""
        return await self._session.status()

    async def stop(self) -> None:
        """Stop motion in place at once; returns when the machine stands still.

        Orders that still wait for their turn are not carried out.

        Raises:
            DeviceError: The machine could not be stopped, or it is not known whether it was.
        """
        await self._session.stop(self._settings.position_tolerance_mm)

    async def reload(self) -> None:
        """Make it read its config again while it is switched off; sliders must not move.

        Raises:
            DeviceError: The command failed, the machine does not come back, or a joint moved.
        """
        stops = self._session.stop_count
        async with self._turn:
            commands = await self._session.synchronized()
            before = await commands.joints()
            await readiness.switch_machine(commands, self._patience, on=False)
            if command := self._settings.reload_command:
                await reload_command.run(command, self._name, self._patience.reload)
            again = await self._session.reconnect()
            if again is not commands:  # a LinuxCNC that was started anew is in emergency stop
                await readiness.leave_emergency_stop(again, self._patience)
            await readiness.switch_machine(again, self._patience, on=True)
            if not await self._home_if_needed(again, stops):
                self._expect_unmoved(before, await again.joints())
            await readiness.enter_mdi_mode(again, self._patience)

    async def close(self) -> None:
        """Let the connection go; closing twice is harmless."""
        await self._session.close()

    async def _home_if_needed(self, commands: ControllerCommands, stops: int) -> bool:
        if await commands.all_homed():
            return False
        limit_s, poll_s = self._settings.move_timeout_s, self._patience.poll
        await readiness.home_joints(commands, limit_s, poll_s, lambda: self._was_stopped_since(stops))
        return True

    def _rapid_move(self, pose: Pose) -> str:
        try:
            return rapid_move(pose)
        except ValueError as error:
            raise MoveRefused(f"to move to {pose}", str(error), subject=self._name) from error

    async def _travel(self, commands: ControllerCommands, block: str, pose: Pose) -> None:
        limit_s = self._settings.move_timeout_s
        try:
            await commands.set(f"mdi {block}", limit_s)
        except CommandRefused as refusal:
            move = f"to move to {pose}"
            raise MoveRefused(move, refusal.reason, subject=self._name, action=refusal.action) from refusal
        except ResponseTimeout as overdue:
            await self.stop()
            problem = f"was still moving after {limit_s:g} s and was stopped"
            action = "Raise controller.move_timeout_s if the move was as it should be"
            raise MotionInterrupted(problem, subject=self._name, action=action) from overdue
        except ConnectionLost:
            await self.stop()
            raise
        except asyncio.CancelledError:
            with suppress(DeviceError):
                await self.stop()
            raise

    async def _expect_at(self, commands: ControllerCommands, target: Pose, stops: int) -> None:
        give_up = _now() + self._patience.arrival
        while not self._agree(there := await commands.pose(), target):
            was_told_to = self._was_stopped_since(stops)
            if was_told_to or _now() > give_up:
                reason = "it was told to" if was_told_to else await commands.reason()
                raise MotionInterrupted(
                    f"stopped at {there} on the way to {target}: {reason}",
                    subject=self._name,
                    action="Find out why it stopped, then prepare it and measure this pose again",
                )
            await asyncio.sleep(self._patience.poll)

    def _agree(self, one: Pose, other: Pose) -> bool:
        position, angle = pose_difference(one, other)
        settings = self._settings
        return position <= settings.position_tolerance_mm and angle <= settings.angle_tolerance_deg

    def _was_stopped_since(self, stops: int) -> bool:
        return self._session.stop_count != stops

    def _expect_unmoved(self, before: tuple[float, ...], after: tuple[float, ...]) -> None:
        moved = [abs(new - old) for new, old in zip(after, before, strict=True)]
        if max(moved) > self._settings.position_tolerance_mm:
            joint = moved.index(max(moved)) + 1
            raise DeviceError(
                f"moved joint {joint} by {max(moved):.3f} mm while it read its config again",
                subject=self._name,
                action="Check the machine and its config before it moves again",
            )


def _now() -> float:
    return asyncio.get_running_loop().time()
