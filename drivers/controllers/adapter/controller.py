"""A controller that a program serves by the adapter protocol (docs/controller-adapter.md)."""

import asyncio
import logging
import math
from contextlib import suppress
from typing import TypeVar, cast

from drivers import errors, interfaces
from drivers.controllers.adapter.link import Link, Timeouts
from drivers.controllers.adapter.messages import Failed, Nothing, Position, Status
from drivers.controllers.adapter.options import AdapterOptions, Program
from drivers.controllers.adapter.session import Session
from drivers.controllers.poses import agree, aside, from_wire, on_wire, require_unmoved
from drivers.controllers.reload_command import run_reload_command
from drivers.interfaces import StartupAction
from drivers.wire_trace import TraceRecorder
from hexacell.cell.robot import ControllerOptions, ControllerSettings
from hexacell.errors import DeviceError, UsageError
from hexacell.kinematics.pose import Pose

_log = logging.getLogger("drivers.controllers.adapter")

AnswerT = TypeVar("AnswerT")

_TIMEOUTS = Timeouts()
_REQUESTS = {
    StartupAction.RESET_INITIAL_ESTOP: "reset-estop",
    StartupAction.RESET_ESTOP: "reset-estop",
    StartupAction.SWITCH_ON: "switch-on",
    StartupAction.HOME: "home",
}
_LEFT_TOLERANCES = 10.0
"""A robot that nobody commands may move by so many tolerances of an arrival before the next move."""


class AdapterController:
    """``drivers.interfaces.Controller`` by a program that is trusted in nothing.

    Orders run one after another; ``stop``, ``status``, ``position`` and ``close`` do not wait for them.
    After a failure nothing moves before it was prepared again, which also replaces a link that broke.
    """

    Options: type[ControllerOptions] = AdapterOptions
    converts_units = False
    """Whether the program converts what a controller reports in ``controller.unit_mm``."""

    def __init__(
        self,
        settings: ControllerSettings,
        program: Program | None = None,
        *,
        trace: TraceRecorder | None = None,
        timeouts: Timeouts = _TIMEOUTS,
    ) -> None:
        program = program or cast("AdapterOptions", settings.options).program
        self._name = program.name
        if settings.unit_mm != 1.0 and not self.converts_units:
            raise UsageError("the adapter counts in mm", action="Remove controller.unit_mm")
        self._settings, self._timeouts = settings, timeouts
        self._session = Session(program, settings, timeouts, trace, self._lose)
        self._order, self._stopping = asyncio.Lock(), asyncio.Lock()
        self._stop_count = 0
        self._unready = "it was not prepared"
        self._was_enabled = self._is_reloading = self._is_unstopped = False
        self._joints_before_reload: tuple[float, ...] | None = None
        self._here: Pose | None = None

    async def open(self) -> interfaces.DeviceIdentity:
        """Start the program, or connect to it; nothing moves.

        Raises:
            DeviceError: it is not there, ends, does not answer, or not as the protocol has it.
        """
        async with self._order:
            return await self._session.open()

    async def prepare(self, permitted: interfaces.StartupActions) -> None:
        """Leave emergency stop, switch on, home, as far as it is permitted. May move the robot.

        Raises:
            StartupNotPermitted: it needs one of these that is not permitted.
            MotionInterrupted: ``stop`` was called during it.
            DeviceError: a step fails or has no effect, or it takes no commands from here.
        """
        stops = self._stop_count
        async with self._order:
            self._unready = "its last preparation failed"
            await self._make_ready(await self._session.linked(self._timeouts.connect), permitted, stops)

    async def move(self, pose: Pose, duration_s: float) -> None:
        """Move to ``pose`` in no less than ``duration_s``; returns when the robot rests there.

        On cancellation, and if it takes more than twice as long and some seconds, the robot is stopped.

        Raises:
            PoseRefused: the pose is out of reach or limits.
            MoveRefused: the controller is not prepared, or refuses.
            MotionInterrupted: the motion ended before its target.
            DeviceError: the link broke, or the robot could not be stopped.
        """
        stops = self._stop_count
        async with self._order:
            link = self._session.connected()
            if self._unready or self._is_unstopped:
                raise self._refused(pose, self._unready or "it could not be stopped", "Prepare it again")
            if self._stop_count != stops:
                raise errors.MotionInterrupted("was stopped before it moved", subject=self._name)
            if not all(map(math.isfinite, (*pose.as_tuple(), duration_s))):
                raise self._refused(pose, "a coordinate is not a finite number")
            self._unready = "its last move failed"
            await self._carry_out(link, pose, duration_s, stops)
            self._unready, self._here = "", pose

    async def position(self) -> interfaces.ReportedPosition | None:
        """Pose and joints, also during ``move``; None where it does not know them."""
        found = await self._position(self._session.connected())
        if found.pose is None:
            return None
        return interfaces.ReportedPosition(self._pose(found.pose), _joints(found))

    async def joints_now(self) -> tuple[float, ...] | None:
        """The joints, also during ``move``; None where it does not know them."""
        return _joints(await self._position(self._session.connected()))

    async def status(self) -> interfaces.ControllerStatus:
        """Emergency stop, enabled, and what is wrong if it cannot move; also during ``move``."""
        status = await self._status(self._session.connected())
        may_move = status.enabled and not status.estop
        told = () if may_move else tuple(status.errors)
        if not status.remote:
            told = ("it takes no commands from here", *told)
        is_ours = status.enabled and status.remote
        return interfaces.ControllerStatus(status.estop, is_ours, told, status.heartbeat)

    async def stop(self) -> None:
        """Stop the motion in place; returns at rest. Orders that are still waiting are not executed.

        Where the link is broken or breaks, or the stop is refused, another one is opened for it.

        Raises:
            DeviceError: the robot could not be stopped, or that is unknown.
        """
        self._stop_count += 1
        _log.info("%s: stop", self._name)
        async with self._stopping:
            try:
                try:
                    await self._stop_over(self._session.connected())
                except (errors.ConnectionLost, errors.CommandRefused) as error:
                    self._session.fail(error.problem)  # perhaps its own connection to the robot is lost
                    await self._stop_over(await self._session.linked(self._timeouts.stop))
            except DeviceError as error:
                self._is_unstopped = True
                problem = f"could not be stopped: it {error.problem}"
                raise DeviceError(problem, subject=self._name, action="Press the emergency stop") from error

    async def reload(self, permitted: interfaces.StartupActions) -> None:
        """Have it read its geometry again while it is switched off; joints must not move.

        Raises:
            StartupNotPermitted: it needs more than to be switched on again.
            DeviceError: it fails, does not come back, or a joint moved.
        """
        stops = self._stop_count
        async with self._order:
            link = self._session.connected()
            self._unready = "its last reload failed"
            status = await self._status(link)
            if status.enabled and not status.estop:
                self._joints_before_reload = _joints(await self._position(link))
                await self._do(link, "switch-off", self._timeouts.command)
                self._is_reloading = True
            if command := self._settings.reload_command:
                await run_reload_command(command, self._name, self._timeouts.reload)
                self._was_enabled = False  # it may be in the emergency stop that it starts in
                link = await self._session.relinked()
            else:
                await self._do(link, "reload", self._timeouts.reload)
            await self._make_ready(link, permitted, stops)

    async def close(self) -> None:
        """End the program, or the connection to it; closing twice is harmless."""
        await self._session.close()

    def _lose(self) -> None:
        """There is to be another link."""
        self._unready = self._unready or "its connection was lost"

    async def _status(self, link: Link) -> Status:
        status = self._done(await link.ask("status", Status), "status")
        self._was_enabled |= status.enabled
        return status

    async def _position(self, link: Link) -> Position:
        found, own = (
            self._done(await link.ask("position", Position), "position"),
            self._settings.coordinates,
        )
        for what, numbers in (("coordinates", found.pose), ("joints", found.joints)):
            if numbers is not None and len(numbers) != len(own):
                raise DeviceError(
                    f"reports {len(numbers)} {what}, and the robot has {len(own)}: {own}",
                    subject=self._name,
                    action="Correct its program, or robot.mechanism in the cell file",
                )
        return found

    def _done(self, answer: AnswerT | Failed, do: str) -> AnswerT:
        if not isinstance(answer, Failed):
            return answer
        if answer.kind == "interrupted":
            raise errors.MotionInterrupted(
                f"was interrupted: '{do}' ended early, {answer.reason}",
                subject=self._name,
                action="Find out why, then prepare it again",
            )
        raise errors.CommandRefused(f"'{do}'", answer.reason, subject=self._name, action=answer.action)

    async def _do(self, link: Link, do: str, limit_s: float) -> None:
        """An order other than a move; what is not done in time, or is cancelled, is stopped."""
        try:
            self._done(await link.ask(do, Nothing, limit_s), do)
        except TimeoutError:
            await self.stop()
            problem = f"has not done '{do}' after {limit_s:g} s"
            raise DeviceError(problem, subject=self._name, action="Look at the controller itself") from None
        except asyncio.CancelledError:
            with suppress(DeviceError):
                await self.stop()
            raise

    async def _make_ready(self, link: Link, permitted: interfaces.StartupActions, stops: int) -> None:
        last: StartupAction | None = None
        while (action := self._next_action(status := await self._undisturbed(link))) is not None:
            if action is last:
                said = "; ".join(status.errors) or "it gives no reason"
                problem = f"says that '{_REQUESTS[action]}' is done, which had no effect: {said}"
                raise DeviceError(problem, subject=self._name, action="Look at the controller itself")
            # This driver has switched it off, unless there was an emergency stop since.
            self._is_reloading &= action is not StartupAction.RESET_ESTOP
            is_ours = self._is_reloading and action is StartupAction.SWITCH_ON
            if not is_ours and action not in permitted:
                raise errors.StartupNotPermitted(action, self._name)
            permitted -= {action}  # what is needed again was undone by somebody
            if self._stop_count != stops:
                raise errors.MotionInterrupted("was stopped before it was ready", subject=self._name)
            homes = action is StartupAction.HOME
            if homes:
                self._joints_before_reload = None  # they may move
            limit_s = self._settings.homing_timeout_s if homes else self._timeouts.command
            await self._do(link, _REQUESTS[action], limit_s)
            last = action
        await self._require_place(link)
        self._unready, self._is_reloading, self._is_unstopped = "", False, False

    async def _undisturbed(self, link: Link) -> Status:
        """Its status; raises ``DeviceError`` where somebody else commands it."""
        status = await self._status(link)
        if not status.remote:
            action = "Switch it to remote, or to automatic, then prepare it again"
            raise DeviceError("takes no commands from here", subject=self._name, action=action)
        if status.moving:
            await self.stop()
            action = "See that nobody else moves the robot, then prepare it again"
            raise errors.MotionInterrupted("moved without being asked", subject=self._name, action=action)
        return status

    async def _require_place(self, link: Link) -> None:
        """Require that it is where it was before a reload."""
        found = await self._position(link)
        if found.pose is None:
            action = "Home it again, or correct its program"
            raise DeviceError("is homed, and does not know where it is", subject=self._name, action=action)
        before, joints = self._joints_before_reload, _joints(found)
        # With other zeros it reports other joints where it stands: encoders then show whether it moved.
        if before is not None and joints is not None and not self._settings.joints_include_zeros:
            require_unmoved(before, joints, self._settings.position_tolerance_mm, self._name)
        self._joints_before_reload, self._here = None, self._pose(found.pose)

    def _is_later_estop(self, status: Status) -> bool:
        """Whether it was not in this emergency stop when it was started."""
        del status
        return self._was_enabled

    def _next_action(self, status: Status) -> StartupAction | None:
        """The next action that it needs before it can move; None if it is ready."""
        if status.estop:
            is_later = self._is_later_estop(status)
            return StartupAction.RESET_ESTOP if is_later else StartupAction.RESET_INITIAL_ESTOP
        if not status.enabled:
            return StartupAction.SWITCH_ON
        return None if status.homed else StartupAction.HOME

    async def _carry_out(self, link: Link, pose: Pose, duration_s: float, stops: int) -> None:
        """Move, and return at rest at the pose."""
        limit_s = 2.0 * duration_s + self._timeouts.beyond_move
        start = await self._start(link)
        self._here = None
        try:
            answer = await link.ask(
                "move",
                Nothing,
                limit_s,
                {"pose": on_wire(pose, self._settings.coordinates), "duration_s": duration_s},
                lambda at: self._aside(start, at, pose),
            )
        except TimeoutError:
            await self.stop()
            problem = f"was still moving after {limit_s:g} s and was stopped"
            action = "Look for what slows it down, or state less [speed]"
            raise errors.MotionInterrupted(problem, subject=self._name, action=action) from None
        except errors.ConnectionLost:
            await self.stop()
            raise
        except asyncio.CancelledError:
            with suppress(DeviceError):
                await self.stop()
                self._unready = ""
            raise
        if isinstance(answer, Failed):
            await self._raise_failure(link, answer, start, pose, stops)
        await self._verify(link, pose, stops)

    async def _start(self, link: Link) -> Pose:
        """Where it stands before a move: where the last one left it."""
        here = (await self._position(link)).pose
        if here is not None and (
            self._here is None or agree(self._pose(here), self._here, self._settings, _LEFT_TOLERANCES)
        ):
            return self._pose(here)
        where = "nowhere" if here is None else f"at {self._pose(here)}"
        raise errors.MotionInterrupted(
            f"is {where}, and was left at {self._here}: it moved without a command",
            subject=self._name,
            action="Find out what moved it, then prepare it again",
        )

    async def _raise_failure(
        self, link: Link, failed: Failed, start: Pose, target: Pose, stops: int
    ) -> None:
        """Raise the error for a move that failed, the robot at rest."""
        if failed.kind in {"pose", "refused"}:
            await self._verify(link, start, stops)  # nothing moved
            if failed.kind == "refused":
                raise self._refused(target, failed.reason, failed.action)
            self._unready, self._here = "", start
            raise errors.PoseRefused(
                f"to move to {target}",
                failed.reason,
                subject=self._name,
                axis=failed.axis,
                is_highest=failed.highest,
            )
        was_stopped = self._stop_count != stops and failed.kind == "interrupted"
        await self.stop()
        there = (await self._position(self._session.connected())).pose
        where = "" if there is None else f" at {self._pose(there)}"
        if was_stopped:
            self._unready = ""
        raise errors.MotionInterrupted(
            f"stopped{where} before reaching {target}: {failed.reason}",
            subject=self._name,
            action="Find out why it stopped, then prepare it and measure this pose again",
        )

    async def _verify(self, link: Link, pose: Pose, stops: int) -> None:
        """Require that it rests at a pose; it is stopped where it does not."""
        deadline = _now() + self._timeouts.arrival
        while True:
            status, found = await self._status(link), await self._position(link)
            there = None if found.pose is None else self._pose(found.pose)
            if not status.moving and there is not None and agree(there, pose, self._settings):
                return
            if status.moving or _now() > deadline:
                break
            await asyncio.sleep(self._timeouts.poll)
        was_stopped = self._stop_count != stops
        await self.stop()
        if was_stopped:
            self._unready = ""
        raise errors.MotionInterrupted(
            f"{'moves' if status.moving else 'rests'} at {there or 'no known place'}, and does not rest at "
            f"{pose}, after {'it was stopped' if was_stopped else 'it said that the move was over'}",
            subject=self._name,
            action="Find out why, then prepare it and measure this pose again",
        )

    async def _stop_over(self, link: Link) -> None:
        limit_s = self._timeouts.stop
        deadline = _now() + limit_s
        while True:  # again, as the first one may precede the motion
            self._done(await link.ask("stop", Nothing, limit_s), "stop")
            if await link.has_ended(self._timeouts.poll) and not (await self._status(link)).moving:
                return
            if _now() > deadline:
                link.fail(f"still moves {limit_s:g} s after the stop command")
                link.require_sound()

    def _aside(self, start: Pose, at: list[float], target: Pose) -> str | None:
        """What is wrong with where it says that it is on its way, if anything is."""
        if len(at) != len(self._settings.coordinates):
            return f"says that it is at {at}, and the robot has {self._settings.coordinates}"
        return aside(start, self._pose(at), target)

    def _pose(self, numbers: list[float]) -> Pose:
        """The pose of the coordinates that the robot has."""
        return from_wire(numbers, self._settings.coordinates)

    def _refused(self, pose: Pose, reason: str, action: str | None = None) -> errors.MoveRefused:
        return errors.MoveRefused(f"to move to {pose}", reason, subject=self._name, action=action)


def _joints(found: Position) -> tuple[float, ...] | None:
    return None if found.joints is None else tuple(found.joints)


def _now() -> float:
    return asyncio.get_running_loop().time()
