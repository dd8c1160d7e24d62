"""A LinuxCNC machine, driven through its network shell linuxcncrsh."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import PurePath

from drivers import errors, interfaces
from drivers.controllers.linuxcnc import gcode, protocol, startup
from drivers.controllers.linuxcnc.commands import ControllerCommands
from drivers.controllers.linuxcnc.session import Session
from drivers.controllers.poses import agree, require_unmoved
from drivers.controllers.reload_command import run_reload_command
from drivers.wire_trace import TraceRecorder
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

_TIMEOUTS = protocol.Timeouts()


class LinuxcncrshController:
    """``drivers.interfaces.Controller`` over TCP.

    Orders run one after another; ``stop``, ``status`` and ``close`` do not wait for them. The next
    order replaces a broken connection. A controller that was restarted, or whose control another
    client took, must be prepared again. States and locks are described in ``session.py``.
    """

    def __init__(
        self,
        settings: ControllerSettings,
        *,
        trace: TraceRecorder | None = None,
        timeouts: protocol.Timeouts = _TIMEOUTS,
    ) -> None:
        self._name = protocol.subject_of(settings)
        self._settings = settings
        self._timeouts = timeouts
        self._session = Session(settings, timeouts, trace)
        self._order = asyncio.Lock()
        self._joints_before_reload: tuple[float, ...] | None = None
        self._restoring = gcode.restoring_block("")
        self._has_changed_modes = False
        self._is_unready = False

    async def open(self) -> interfaces.DeviceIdentity:
        """Connect and take control; nothing moves.

        Raises:
            DeviceError: No server, no responding linuxcncrsh, or a wrong password.
        """
        async with self._order:
            commands = await self._session.open()
            config = PurePath(await commands.get_if_known("inifile")).name
            return interfaces.DeviceIdentity(
                name=self._name,
                protocol="linuxcncrsh",
                description=", ".join(filter(None, (commands.connection.server, config))),
            )

    async def check(self) -> None:
        """Check that its coordinates are those of the machine; nothing is set, nothing moves.

        Raises:
            DeviceError: Units, offsets, modal codes or the feed override make moves other than commanded.
        """
        async with self._order:
            await startup.check_coordinate_system(await self._session.synchronized())

    async def prepare(self, permitted: interfaces.StartupActions) -> None:
        """Leave emergency stop, switch on, home, enter MDI mode. May move the machine.

        Coordinates are checked before it is homed, and again afterwards.

        Raises:
            StartupNotPermitted: It needs one of these that is not permitted.
            MotionInterrupted: ``stop`` was called during it.
            DeviceError: A step has no effect, or units, offsets or modal codes change coordinates.
        """
        stops = self._session.stop_count
        async with self._order:
            with self._ready_if_done():
                commands = await self._session.in_control()
                await startup.acknowledge_on_completion(commands)
                await self._make_ready(commands, permitted, stops)
                if self._has_changed_modes:
                    await self._restore_modes(commands)
                self._restoring = gcode.restoring_block(await startup.check_coordinate_system(commands))

    async def move(self, pose: Pose, duration_s: float) -> None:
        """Move to ``pose`` in inverse time; returns when the actual pose agrees with it.

        The modes are then what they were. On cancellation, and if it takes more than twice as long and some
        seconds, the machine is stopped.

        Raises:
            PoseRefused: The pose is out of reach or limits.
            MoveRefused: The controller is not prepared, or its last preparation failed.
            MotionInterrupted: it stopped at another pose, which the message names.
            DeviceError: The connection broke.
        """
        stops = self._session.stop_count
        try:
            block = gcode.timed_move(pose.as_tuple(), duration_s)
        except ValueError as error:
            raise errors.MoveRefused(f"to move to {pose}", str(error), subject=self._name) from error
        limit_s = 2.0 * duration_s + self._timeouts.beyond_move
        async with self._order:
            commands = await self._session.synchronized()
            if self._was_stopped_since(stops):
                raise self._stopped_before_moving()
            if self._is_unready:
                reason, action = "its last preparation failed", "Prepare it again"
                raise errors.MoveRefused(f"to move to {pose}", reason, subject=self._name, action=action)
            await self._execute(commands, block, pose, stops, limit_s)
            await self._verify_arrival(commands, pose, stops, limit_s)
            try:
                await self._restore_modes(commands)
            except errors.CommandRefused:
                if not self._was_stopped_since(stops):  # the stop took control: they are restored later
                    raise

    async def position(self) -> interfaces.ReportedPosition | None:
        """Actual pose and joints; None before all joints are homed, when both may be those of home."""
        async with self._order:
            commands = await self._session.synchronized()
            if not await commands.all_homed():
                return None
            return interfaces.ReportedPosition(await commands.pose(), await commands.joints())

    async def joints_now(self) -> tuple[float, ...] | None:
        """The six joints, also during ``move``; None before all are homed."""
        return await self._session.joints()

    async def status(self) -> interfaces.ControllerStatus:
        """Emergency stop, enabled, and error messages; also during ``move``."""
        return await self._session.status()

    async def stop(self) -> None:
        """Stop the motion in place; returns at standstill.

        Orders that are still waiting are not executed.

        Raises:
            DeviceError: The machine could not be stopped, or that is unknown.
        """
        await self._session.stop(self._settings.position_tolerance_mm)

    async def reload(self, permitted: interfaces.StartupActions) -> None:
        """Reload its config while it is switched off; joints must not move.

        Raises:
            StartupNotPermitted: It was restarted, or came into emergency stop, and needs more than to be
                switched on again.
            DeviceError: The command failed, the machine does not come back, or a joint moved.
        """
        stops = self._session.stop_count
        async with self._order:
            with self._ready_if_done():
                commands = await self._session.synchronized()
                if await commands.is_on("machine"):
                    self._joints_before_reload = await commands.joints()
                await startup.switch_machine(commands, self._timeouts, on=False)
                if command := self._settings.reload_command:
                    await run_reload_command(command, self._name, self._timeouts.reload)
                await self._make_ready(await self._session.reconnect(), permitted, stops)

    async def close(self) -> None:
        """Close all connections, the modes restored if that is possible; closing twice is harmless."""
        if self._has_changed_modes:
            with suppress(DeviceError, TimeoutError):
                async with asyncio.timeout(self._timeouts.restore), self._order:
                    await self._restore_modes(await self._session.synchronized())
        await self._session.close()

    @contextmanager
    def _ready_if_done(self) -> Iterator[None]:
        """What fails in this context leaves a controller that moves nothing until it is prepared again."""
        self._is_unready = True
        yield
        self._is_unready = False

    async def _restore_modes(self, commands: ControllerCommands) -> None:
        await startup.restore_modes(commands, self._restoring, self._timeouts)
        self._has_changed_modes = False

    async def _make_ready(
        self, commands: ControllerCommands, permitted: interfaces.StartupActions, stops: int
    ) -> None:
        if self._joints_before_reload is not None:  # then it was on, and this driver switched it off
            permitted |= {interfaces.StartupAction.SWITCH_ON}
        while (action := await startup.next_action(commands)) is not None:
            if action is interfaces.StartupAction.RESET_ESTOP:
                self._joints_before_reload = None  # somebody else switched it off
            if action not in permitted:
                raise errors.StartupNotPermitted(action, self._name)
            permitted -= {action}  # what is needed again was undone by somebody
            await self._start_up(commands, action, stops)
        self._session.was_enabled = True
        if self._joints_before_reload is not None:
            # With other zeros it reports other joints where it stands: encoders then show whether it moved.
            if not self._settings.joints_include_zeros:
                require_unmoved(
                    self._joints_before_reload,
                    await commands.joints(),
                    self._settings.position_tolerance_mm,
                    self._name,
                )
            self._joints_before_reload = None
        await startup.enter_mdi_mode(commands, self._timeouts)

    async def _start_up(
        self, commands: ControllerCommands, action: interfaces.StartupAction, stops: int
    ) -> None:
        match action:
            case interfaces.StartupAction.SWITCH_ON:
                await startup.switch_machine(commands, self._timeouts, on=True)
            case interfaces.StartupAction.HOME:
                await startup.check_coordinate_system(commands)
                self._joints_before_reload = None  # they may move
                limit_s, poll_s = self._settings.homing_timeout_s, self._timeouts.poll
                await startup.home_joints(commands, limit_s, poll_s, lambda: self._was_stopped_since(stops))
            case _:
                await startup.leave_emergency_stop(commands, self._timeouts)

    async def _execute(
        self, commands: ControllerCommands, block: str, pose: Pose, stops: int, limit_s: float
    ) -> None:
        self._has_changed_modes = True
        try:
            await commands.set(f"mdi {block}", limit_s)
        except errors.CommandRefused as refusal:
            if self._was_stopped_since(stops):  # the stop took control before the move was received
                raise self._stopped_before_moving() from refusal
            raise self._move_refusal(pose, refusal.reason, refusal.action) from refusal
        except errors.ResponseTimeout as overdue:
            await self.stop()
            problem = f"was still moving after {limit_s:g} s and was stopped"
            action = "Look for what slows it down: its feed override, or [speed] beyond what it can do"
            raise errors.MotionInterrupted(problem, subject=self._name, action=action) from overdue
        except errors.ConnectionLost:
            await self.stop()
            raise
        except asyncio.CancelledError:
            with suppress(DeviceError):
                await self.stop()
            raise

    def _move_refusal(self, pose: Pose, reason: str, action: str | None) -> errors.MoveRefused:
        move = f"to move to {pose}"
        if (found := gcode.parse_pose_refusal(reason)) is None:
            return errors.MoveRefused(move, reason, subject=self._name, action=action)
        axis, is_highest = found
        return errors.PoseRefused(move, reason, subject=self._name, axis=axis, is_highest=is_highest)

    def _stopped_before_moving(self) -> errors.MotionInterrupted:
        return errors.MotionInterrupted("was stopped before it moved", subject=self._name)

    async def _verify_arrival(
        self, commands: ControllerCommands, target: Pose, stops: int, limit_s: float
    ) -> None:
        """Wait until it is there; on a computer under load the move is acknowledged before its end."""
        here, still_s = None, protocol.loop_time()
        last_s = still_s + limit_s
        while not agree(there := await commands.pose(), target, self._settings):
            if here is None or not agree(there, here, self._settings):
                here, still_s = there, protocol.loop_time()
            was_stopped = self._was_stopped_since(stops)
            if was_stopped or protocol.loop_time() > min(still_s + self._timeouts.arrival, last_s):
                reason = "it was stopped on request" if was_stopped else await commands.reason()
                if not was_stopped and gcode.parse_pose_refusal(reason):  # acknowledged all the same
                    raise self._move_refusal(target, reason, None)
                raise errors.MotionInterrupted(
                    f"stopped at {there} before reaching {target}: {reason}",
                    subject=self._name,
                    action="Find out why it stopped, then prepare it and measure this pose again",
                )
            await asyncio.sleep(self._timeouts.poll)

    def _was_stopped_since(self, stops: int) -> bool:
        return self._session.stop_count != stops
