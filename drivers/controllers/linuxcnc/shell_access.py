"""LinuxCNC by its network shell linuxcncrsh, which may be on another computer.

Two connections: one for commands, which may wait as long as a move, and one for queries, which a stop
takes over; where a query holds that one, the stop opens another. LinuxCNC gives control to the client that
asked for it last: a stop takes it from the connection for commands, and the next command takes it back.
"""

import threading
import time
from collections.abc import Sequence
from functools import cached_property
from pathlib import PurePath

from drivers.controllers.adapter.served_robot import FailedError, Told
from drivers.controllers.linuxcnc.access import ALONE, Order, State
from drivers.controllers.linuxcnc.shell_connection import Connection
from drivers.controllers.linuxcnc.shell_protocol import Limits, Response, parse_number, parse_positions
from drivers.controllers.poses import agree
from drivers.errors import ConnectionLost
from drivers.wire_trace import LineRecord
from hexacell.cell.robot import ControllerSettings
from hexacell.kinematics.pose import Pose

_RELEASED_S = 0.05
"""Longest wait of a stop for a query in progress; it is answered within a millisecond."""

_PAUSE_S = 0.02
"""Between two looks at the joints, which show whether they move."""
_EQUAL_POSITIONS = 3
"""Successive joint positions that must agree before the machine is considered at standstill."""

_MOST_MESSAGES = 100
_UNITS_MM = {"MM": 1.0, "CM": 10.0, "INCH": 25.4}
_MODES = {"AUTO": "automatic"}


class ShellAccess:
    """``access.Access`` by linuxcncrsh; where that is gone, ``ConnectionLost`` ends the service."""

    poll_s = 0.002

    def __init__(self, settings: ControllerSettings, limits: Limits, wire: LineRecord) -> None:
        self.settings = settings
        self._limits, self._wire = limits, wire
        self._line, self._asking, self._stopping = threading.Lock(), threading.Lock(), threading.Lock()
        self._commands: Connection | None = None
        self._queries: Connection | None = None
        self._is_in_control = False
        self._explained: list[str] = []
        self.is_refused = False
        self._ended_s: float | None = None
        self._forgotten_s, self._seen_s = 0.0, 0.0
        self._seen: Sequence[float] = ()

    def connect(self, _told: Told) -> Told:
        """Connect, and take control."""
        self._commands = commands = self._open(self._limits, commanding=True)
        self._is_in_control = True
        # Acknowledged when it is done, not when it is received; 2.10 calls it wait_mode.
        if not commands.request("set set_wait done").accepted:
            commands.request("set wait_mode done")
        description = PurePath(self.ask_if_known("inifile")).name
        return {"name": commands.server, "description": description}

    def claim(self) -> None:
        """Take control, whoever has it."""
        self._is_in_control = False
        self._own()

    def close(self) -> None:
        """Close both connections; whoever waits for one fails."""
        for connection in (self._commands, self._queries):
            if connection is not None:
                connection.close()

    def state(self) -> State:
        """Its state; each part is asked for when it is needed."""
        return ShellState(self)

    def order(self, order: Order) -> bool:
        """Give an order, and wait until it is acknowledged; whether it is."""
        response = self._own().request(f"set {order.value}", self._limits.command)
        self._forget()
        return self._is_accepted(response)

    def begin(self, block: str) -> None:
        """Have a block executed."""
        self._own().send(f"set mdi {block}")
        self._forget()
        self._ended_s, self.is_refused = None, False

    def is_over(self, state: State, pose: Sequence[float] | None = None) -> bool:
        """Whether the block was answered, and the machine is there or stands still.

        On a computer under load a move is acknowledged before its end.
        """
        commands = self._for_commands()
        if commands.is_waiting:
            if (response := commands.response(_PAUSE_S)) is None:
                return False
            self.is_refused = not self._is_accepted(response)
            self._forget()
        if pose is None and self.is_refused:
            raise FailedError("refused", "it refuses to restore its modes")
        if pose is None or self.is_refused or state.is_at(pose):
            return True
        now = time.monotonic()
        if self._ended_s is None or not state.is_at_rest:
            self._ended_s = now
        return now - self._ended_s > self._limits.arrival

    def abort(self) -> None:
        """Stop over the connection for queries, or over another one."""
        with self._stopping:
            is_free = self._asking.acquire(timeout=_RELEASED_S)
            try:
                self._is_in_control = False
                self._forget()
                if not (is_free and self._queries and self._is_stopped_over(self._queries)):
                    self._stop_over_another(is_free=is_free)
            finally:
                if is_free:
                    self._asking.release()

    def messages(self) -> list[str]:
        """Its error messages, of a refusal and of its queue."""
        found, self._explained = self._explained, []
        while len(found) < _MOST_MESSAGES and (text := self.ask("error")).upper() != "OK":
            found.append(text)
        return found

    def ask(self, what: str) -> str:
        """The text after ``WHAT``; raises ``FailedError`` if the server does not know ``what``."""
        if (response := self._asked(what)).accepted:
            return response.text
        raise FailedError("fault", f"it does not know 'get {what}'")

    @cached_property
    def units(self) -> str:
        """Its unit of length; empty if the server does not know it."""
        return self.ask_if_known("user_linear_units").upper()

    def ask_if_known(self, what: str) -> str:
        """The text after ``WHAT``; empty if the server does not know ``what``."""
        return self._asked(what).text

    def is_still(self, joints: Sequence[float], asked_s: float) -> bool:
        """Whether joints are where they were seen a while ago, if that was since the last block ended."""
        if asked_s < self._forgotten_s:
            return True
        before = self._seen
        is_first = not before or self._seen_s < self._forgotten_s
        if is_first or asked_s - self._seen_s > _PAUSE_S:
            self._seen_s, self._seen = asked_s, joints
        return is_first or self._is_near(joints, before)

    def _asked(self, what: str) -> Response:
        # Another program's client may garble our command. A query can be repeated safely; a command not.
        with self._asking:
            self._queries = queries = self._queries or self._open(self._limits, commanding=False)
            response = queries.request(f"get {what}")
            return response if response.accepted else queries.request(f"get {what}")

    def _open(self, limits: Limits, *, commanding: bool) -> Connection:
        return Connection.open(self.settings, limits, self._wire, self._line, commanding=commanding)

    def _forget(self) -> None:
        """Where it was seen says no longer whether it moves."""
        self._forgotten_s = time.monotonic()

    def _own(self) -> Connection:
        """The connection for commands, in control unless another client has taken it."""
        with self._stopping:
            commands = self._for_commands()
            if not self._is_in_control:
                commands.take_control()
                self._is_in_control = True
        return commands

    def _for_commands(self) -> Connection:
        """The connection for commands, whoever has control."""
        assert self._commands is not None  # noqa: S101 - connected
        return self._commands

    def _is_accepted(self, response: Response) -> bool:
        """Whether it is; why not is among the messages. Raises where another client has control."""
        if not response.accepted and self._is_in_control:
            if self._for_commands().request("get enable").text.upper() == "OFF":
                raise FailedError("refused", "another client has taken control of it", action=ALONE)
            self._explained += response.explanations
        return response.accepted

    def _is_stopped_over(self, queries: Connection) -> bool:
        """Whether it could be stopped over a connection that may not answer any more."""
        try:
            queries.take_control(self._limits.quick)
            queries.request("set abort", self._limits.quick)
        except (ConnectionLost, FailedError):
            queries.close()
            return False
        self._wait_for_rest(queries)
        return True

    def _stop_over_another(self, *, is_free: bool) -> None:
        hasty = Limits(answer=self._limits.stop, explanation=self._limits.explanation)
        connection = self._open(hasty, commanding=True)
        try:
            connection.request("set abort")
            self._wait_for_rest(connection)
        except BaseException:
            connection.close()
            raise
        if is_free:
            self._queries = connection
        else:
            connection.close()

    def _wait_for_rest(self, connection: Connection) -> None:
        """Until joints stand still; told to stop again, as the first time may precede the motion.

        It is refused while the machine is off, which is fine.
        """
        deadline = time.monotonic() + self._limits.rest
        while not self._is_at_standstill(connection):
            if time.monotonic() > deadline:
                problem = f"it still moves {self._limits.rest:g} s after the stop command"
                raise FailedError("fault", problem)
            connection.take_control()
            connection.request("set abort")

    def _is_at_standstill(self, connection: Connection) -> bool:
        # Joints, and not the pose: where the forward kinematics fails, that stands still while they move.
        first = self.joints_in(connection.request("get joint_pos").text)
        for _ in range(_EQUAL_POSITIONS - 1):
            time.sleep(_PAUSE_S)
            if not self._is_near(self.joints_in(connection.request("get joint_pos").text), first):
                return False
        return True

    def joints_in(self, text: str) -> tuple[float, ...]:
        """The joints of an answer, mm or deg."""
        found = parse_positions(text, len(self.settings.coordinates))
        return tuple(self.settings.joint_unit_mm * value for value in found)

    def _is_near(self, one: Sequence[float], other: Sequence[float]) -> bool:
        apart = (abs(a - b) for a, b in zip(one, other, strict=True))
        return max(apart) <= self.settings.position_tolerance_mm


class ShellState:
    """``access.State``: each part is asked for once, when it is needed."""

    runs_program = False

    def __init__(self, shell: ShellAccess) -> None:
        self._shell, self._settings, self.asked_s = shell, shell.settings, time.monotonic()

    @cached_property
    def is_on(self) -> bool:
        """Whether the machine is on."""
        return self._shell.ask("machine").upper() == "ON"

    @cached_property
    def estop(self) -> bool:
        """Whether it is in emergency stop."""
        return self._shell.ask("estop").upper() == "ON"

    @cached_property
    def is_homed(self) -> bool:
        """Whether every joint is homed."""
        homed = self._shell.ask("joint_homed").upper().split()
        return bool(homed) and all(word == "YES" for word in homed)

    @cached_property
    def mode(self) -> str:
        """The mode of its task."""
        mode = self._shell.ask("mode")
        return _MODES.get(mode.upper(), mode.lower())

    @cached_property
    def is_teleop(self) -> bool:
        """Whether it is in teleoperation mode."""
        return self._shell.ask_if_known("teleop_enable").upper() in {"YES", "ON"}

    @cached_property
    def is_at_rest(self) -> bool:
        """Whether the joints stand still, as far as was seen."""
        return self._shell.is_still(self.joints, self.asked_s)

    @cached_property
    def pose(self) -> Sequence[float]:
        """The actual pose, by its own kinematics."""
        return self._coordinates(self._shell.ask("abs_act_pos"))

    @cached_property
    def joints(self) -> Sequence[float]:
        """The six actual joints."""
        return self._shell.joints_in(self._shell.ask("joint_pos"))

    @cached_property
    def codes(self) -> str:
        """The active codes, once the unit of length is the one that the cell file states.

        Raises:
            FailedError: It counts in another unit.
        """
        unit_mm = self._settings.unit_mm
        units = self._shell.units
        if units and (own_mm := _UNITS_MM.get(units)) != unit_mm:
            action = "Set [TRAJ] LINEAR_UNITS = mm in its INI file"
            raise FailedError(
                "refused",
                f"counts in {units.lower()}, controller.unit_mm is {unit_mm:g}",
                action=f"Set controller.unit_mm = {own_mm:g}" if own_mm else action,
            )
        return self._shell.ask_if_known("program_codes")

    @cached_property
    def offset(self) -> Sequence[float]:
        """The offset of its coordinate system; none where the server does not know it."""
        offset = self._shell.ask_if_known("pos_offset")
        return self._coordinates(offset) if offset else ()

    @cached_property
    def feed_percent(self) -> float:
        """The feed override; not a number where the server does not know it."""
        return parse_number(self._shell.ask_if_known("feed_override"))

    def is_at(self, pose: Sequence[float]) -> bool:
        """Whether the actual pose is this one, within the tolerances of the cell file."""
        return agree(Pose(*self.pose), Pose(*pose), self._settings)

    def _coordinates(self, text: str) -> tuple[float, ...]:
        x, y, z, *angles = parse_positions(text)
        unit_mm = self._settings.unit_mm
        return (unit_mm * x, unit_mm * y, unit_mm * z, *angles)
