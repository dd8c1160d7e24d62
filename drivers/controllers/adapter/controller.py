"""A controller behind a program of any language, by the adapter protocol (docs/controller-adapter.md)."""

import asyncio
import math
from contextlib import suppress
from dataclasses import dataclass
from typing import cast

from drivers import errors, interfaces
from drivers.controllers.adapter import messages
from drivers.controllers.adapter.link import ACTION, AnswerType, Link, RequestFailed
from drivers.controllers.adapter.options import AdapterOptions, Program
from drivers.controllers.poses import pose_difference, require_unmoved
from drivers.controllers.reload_command import run_reload_command
from drivers.wire_trace import TraceRecorder
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

Action = interfaces.StartupAction


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Longest waits, s of real time. A move may take twice its duration and ``beyond_move``."""

    connect: float = 10.0
    answer: float = 5.0
    command: float = 20.0
    arrival: float = 1.0
    poll: float = 0.02
    reload: float = 120.0
    beyond_move: float = 10.0
    closing: float = 5.0


_TIMEOUTS = Timeouts()
LEFT_TOLERANCES = 10.0
"""A robot that nobody commands may move by so many tolerances of an arrival before the next move."""


class AdapterController:
    """``drivers.interfaces.Controller`` behind a program.

    Orders run one after another; ``stop``, ``status``, ``position`` and ``close`` do not wait for them. The
    next one replaces a broken connection. After anything that is not understood the robot is stopped, and
    nothing moves before it was prepared again.
    """

    Options = AdapterOptions

    def __init__(
        self,
        settings: ControllerSettings,
        program: Program | None = None,
        *,
        trace: TraceRecorder | None = None,
        timeouts: Timeouts = _TIMEOUTS,
    ) -> None:
        self._settings, self._trace, self._timeouts = settings, trace, timeouts
        self._program = program or cast("AdapterOptions", settings.options).program
        self._name = self._program.name
        self._link: Link | None = None
        self._hello: messages.Hello | None = None
        self._connecting, self._order = asyncio.Lock(), asyncio.Lock()
        self._stops = 0
        self._is_unready = True
        self._was_enabled = False
        self._left_at: Pose | None = None
        self._joints_before_reload: tuple[float, ...] | None = None

    async def open(self) -> interfaces.DeviceIdentity:
        """Start the program or connect to it, and ask who it is; nothing moves.

        Raises:
            DeviceError: there is none, or it does not speak this protocol.
        """
        async with self._order:
            await self._connected()
            assert self._hello is not None  # noqa: S101 - it is connected
            said = self._hello
            return interfaces.DeviceIdentity(
                name=self._name,
                protocol=self._program.protocol,
                description=", ".join(filter(None, (said.name, said.description))),
                serial_number=said.serial_number,
            )

    async def prepare(self, permitted: interfaces.StartupActions) -> None:
        """Leave emergency stop, switch on, home, as far as it is permitted. May move the machine.

        Raises:
            StartupNotPermitted: it needs one of these that is not permitted.
            MotionInterrupted: ``stop`` was called during it.
            DeviceError: an action has no effect, or it takes no commands from here.
        """
        stops = self._stops
        async with self._order:
            self._is_unready = True
            await self._make_ready(permitted, stops)

    async def move(self, pose: Pose, duration_s: float) -> None:
        """Move to a pose; returns when it reports that pose, at rest.

        On cancellation, and if it takes more than twice as long and some seconds, the robot is stopped.

        Raises:
            PoseRefused: the pose is out of reach or limits.
            MoveRefused: it is not prepared, or refuses to move now.
            MotionInterrupted: it stopped at another pose, which the message names.
            DeviceError: the program failed, or does not do what it says.
        """
        stops = self._stops
        if not all(math.isfinite(value) for value in (*pose.as_tuple(), duration_s)):
            raise errors.MoveRefused(
                f"to move to {pose}", "a coordinate is not a finite number", subject=self._name
            )
        limit_s = 2.0 * duration_s + self._timeouts.beyond_move
        async with self._order:
            if self._is_unready or self._link is None or self._link.broken is not None:
                reason = "it was not prepared since its last failure"
                raise errors.MoveRefused(
                    f"to move to {pose}", reason, subject=self._name, action="Prepare it again"
                )
            await self._require_left_alone()
            if self._stops != stops:
                raise errors.MotionInterrupted("was stopped before it moved", subject=self._name)
            self._left_at, self._is_unready = None, True
            try:
                await self._commanded(
                    "move",
                    limit_s,
                    pose=pose.as_tuple(),
                    duration_s=duration_s,
                    refuses=f"to move to {pose}",
                )
                await self._require_arrival(pose)
            except (errors.MoveRefused, asyncio.CancelledError):
                self._is_unready = False  # it is at rest, and takes other poses
                raise
            except DeviceError:
                if self._stops != stops:  # somebody wanted it
                    self._is_unready = False
                else:
                    await self._stop_after_failure()
                raise
            self._is_unready = False

    async def position(self) -> interfaces.ReportedPosition | None:
        """Pose and joints, also during ``move``; None before it knows them."""
        found = await self._asked("position", messages.Position)
        if found.pose is None:
            return None
        return interfaces.ReportedPosition(Pose(*found.pose), found.joints)

    async def joints_now(self) -> tuple[float, ...] | None:
        """The six joints, also during ``move``; None before they are known."""
        return (await self._asked("position", messages.Position)).joints

    async def status(self) -> interfaces.ControllerStatus:
        """Emergency stop, enabled, and error messages; also during ``move``."""
        found = await self._status()
        said = found.errors if found.remote else ("it takes no commands from here", *found.errors)
        return interfaces.ControllerStatus(
            found.estop, found.enabled and found.remote, tuple(said), found.heartbeat
        )

    async def stop(self) -> None:
        """Stop the motion in place; returns at standstill.

        Raises:
            DeviceError: the robot could not be stopped, or that is unknown.
        """
        self._stops += 1
        try:
            await self._asked("stop", messages.Nothing)
            is_moving = (await self._status()).moving
        except errors.ConnectionLost:  # perhaps the program hangs: another one may stop the robot
            await self._asked("stop", messages.Nothing)
            is_moving = (await self._status()).moving
        if is_moving:
            raise DeviceError(
                "says that it has stopped, and moves", subject=self._name, action="Press its emergency stop"
            )

    async def reload(self, permitted: interfaces.StartupActions) -> None:
        """Reload its config while it is switched off; joints must not move.

        Raises:
            StartupNotPermitted: it needs more than to be switched on again.
            DeviceError: the reload failed, it does not come back, or a joint moved.
        """
        stops = self._stops
        async with self._order:
            self._is_unready = True
            self._left_at = None
            if (await self._status()).enabled:
                self._joints_before_reload = await self.joints_now()
                await self._commanded("switch-off", self._timeouts.command)
            if command := self._settings.reload_command:
                await run_reload_command(command, self._name, self._timeouts.reload)
                await self._disconnect()  # the controller may have been restarted
            else:
                await self._commanded("reload", self._timeouts.reload)
            await self._make_ready(permitted, stops)

    async def close(self) -> None:
        """End the connection, and the program, which stops the robot; closing twice is harmless."""
        await self._disconnect()

    async def _make_ready(self, permitted: interfaces.StartupActions, stops: int) -> None:
        """Do what it needs and is permitted; ``_is_unready`` until all of it is done."""
        if self._joints_before_reload is not None:  # then it was on, and this driver switched it off
            permitted |= {Action.SWITCH_ON}
        done = set[Action]()
        while (action := self._next_action(await self._status())) is not None:
            if action in done:
                raise DeviceError(
                    f"says that it has done '{_WORDS[action]}', which had no effect",
                    subject=self._name,
                    action="Look for a message on the controller's own screen",
                )
            if action not in permitted:
                raise errors.StartupNotPermitted(action, self._name)
            if self._stops != stops:
                raise errors.MotionInterrupted("was stopped before it was ready", subject=self._name)
            if action is not Action.SWITCH_ON:
                self._joints_before_reload = None  # somebody else switched it off, or the joints may move
            homing_s = self._settings.homing_timeout_s
            await self._commanded(
                _WORDS[action], homing_s if action is Action.HOME else self._timeouts.command
            )
            done.add(action)
        before, self._joints_before_reload = self._joints_before_reload, None
        # With other zeros it reports other joints where it stands: encoders then show whether it moved.
        if before is not None and not self._settings.joints_include_zeros:
            after = await self.joints_now()
            if after is not None:
                require_unmoved(before, after, self._settings.position_tolerance_mm, self._name)
        self._left_at = None
        self._is_unready = False

    def _next_action(self, status: messages.Status) -> Action | None:
        if not status.remote:
            raise DeviceError(
                "takes no commands from here", subject=self._name, action="Switch it to remote control"
            )
        if status.moving:
            raise DeviceError(
                "moves, and nobody here has commanded it", subject=self._name, action="Wait until it rests"
            )
        if status.estop:
            return Action.RESET_ESTOP if self._was_enabled else Action.RESET_INITIAL_ESTOP
        if not status.enabled:
            return Action.SWITCH_ON
        self._was_enabled = True
        return None if status.homed else Action.HOME

    async def _require_left_alone(self) -> None:
        """Refuse to move a robot that is not where the last move has left it."""
        if self._left_at is None:
            return
        here = await self.position()
        if here is None or not self._agree(here.pose, self._left_at, LEFT_TOLERANCES):
            self._is_unready = True
            where = "nowhere" if here is None else f"at {here.pose}"
            raise errors.MotionInterrupted(
                f"is {where}, and was left at {self._left_at}: it moved without a command",
                subject=self._name,
                action="Find out what moved it, then prepare it again",
            )

    async def _require_arrival(self, target: Pose) -> None:
        deadline = asyncio.get_running_loop().time() + self._timeouts.arrival
        while True:
            there, status = await self.position(), await self._status()
            if status.moving:
                problem = f"says that the move to {target} is done, and still moves"
            elif there is None:
                problem = f"does not know where it is after the move to {target}"
            elif self._agree(there.pose, target):
                self._left_at = there.pose
                return
            else:
                problem = f"says that it is at {target}, and is at {there.pose}"
            if status.moving or asyncio.get_running_loop().time() > deadline:
                raise errors.MotionInterrupted(
                    problem, subject=self._name, action="Find out why, then prepare it and measure again"
                )
            await asyncio.sleep(self._timeouts.poll)

    async def _commanded(self, do: str, limit_s: float, *, refuses: str = "", **fields: object) -> None:
        """Have something done that may move the robot; it is stopped if it is not done.

        Raises:
            DeviceError: it failed.
        """
        try:
            await self._requested(do, messages.Nothing, limit_s, refuses=refuses or f"'{do}'", **fields)
        except asyncio.CancelledError:
            with suppress(DeviceError):
                await self.stop()
            raise
        except errors.ConnectionLost:
            await self._stop_after_failure()
            raise

    async def _stop_after_failure(self) -> None:
        """Stop what may still move; that this fails too is of less interest than the failure."""
        stops = self._stops
        with suppress(DeviceError):
            await self.stop()
        self._stops = stops  # nobody asked for it

    async def _status(self) -> messages.Status:
        return await self._asked("status", messages.Status)

    async def _asked(self, do: str, wanted: type[AnswerType]) -> AnswerType:
        return await self._requested(do, wanted, self._timeouts.answer, refuses=f"'{do}'")

    async def _requested(
        self, do: str, wanted: type[AnswerType], limit_s: float, *, refuses: str, **fields: object
    ) -> AnswerType:
        link = await self._connected()
        try:
            return await link.request(do, wanted, limit_s, **fields)
        except RequestFailed as failed:
            raise self._error(failed.failure, do, refuses) from failed

    def _error(self, failure: messages.Failure, do: str, refuses: str) -> DeviceError:
        reason, name = failure.reason, self._name
        match failure.kind:
            case messages.FailureKind.POSE if do == "move":
                return errors.PoseRefused(
                    refuses, reason, subject=name, axis=failure.axis, is_highest=failure.highest
                )
            case messages.FailureKind.REFUSED if do == "move":
                return errors.MoveRefused(refuses, reason, subject=name, action=failure.action)
            case messages.FailureKind.POSE | messages.FailureKind.REFUSED:
                return errors.CommandRefused(refuses, reason, subject=name, action=failure.action)
            case messages.FailureKind.INTERRUPTED:
                return errors.MotionInterrupted(
                    f"was interrupted: {reason}", subject=name, action=failure.action or ACTION
                )
            case _:
                return DeviceError(
                    f"failed at '{do}': {reason}", subject=name, action=failure.action or ACTION
                )

    async def _connected(self) -> Link:
        """The connection; a broken one is replaced, after which the controller must be prepared again."""
        async with self._connecting:
            if self._link is not None and self._link.broken is None:
                return self._link
            if self._link is not None:
                await self._link.close(self._timeouts.closing)
            self._is_unready = True
            link = self._link = Link(self._program, self._trace)
            await link.open(self._timeouts.connect)
            address = {} if self._settings.port is None else {"port": self._settings.port}
            try:
                self._hello = await link.request(
                    "hello",
                    messages.Hello,
                    self._timeouts.connect,
                    version=messages.VERSION,
                    host=self._settings.host,
                    **address,
                    settings=dict(self._program.settings),
                )
            except RequestFailed as failed:
                await link.close(self._timeouts.closing)
                raise self._error(failed.failure, "hello", "to begin") from failed
            return link

    async def _disconnect(self) -> None:
        async with self._connecting:
            link, self._link = self._link, None
            self._is_unready = True
            if link is not None:
                await link.close(self._timeouts.closing)

    def _agree(self, one: Pose, other: Pose, tolerances: float = 1.0) -> bool:
        position, angle = pose_difference(one, other)
        settings = self._settings
        return (
            position <= tolerances * settings.position_tolerance_mm
            and angle <= tolerances * settings.angle_tolerance_deg
        )


_WORDS = {
    Action.RESET_INITIAL_ESTOP: "reset-estop",
    Action.RESET_ESTOP: "reset-estop",
    Action.SWITCH_ON: "switch-on",
    Action.HOME: "home",
}
