"""What linuxcncrsh can be asked and told, as typed calls that raise in the controller's own words."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from drivers.controllers.errors import CommandRefused
from drivers.controllers.linuxcnc.connection import Connection
from drivers.controllers.linuxcnc.protocol import Response, parse_homed, parse_pose, parse_positions
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

T = TypeVar("T")

_MOST_ERRORS = 100
_MOST_TOLD = 4


class ControllerCommands:
    """Questions and orders over one connection."""

    def __init__(self, connection: Connection, subject: str) -> None:
        self.connection = connection
        self.subject = subject

    async def get(self, what: str) -> str:
        """The words after ``WHAT``.

        Raises:
            CommandRefused: The server does not know ``what``.
        """
        answer = await self._got(what)
        if not answer.accepted:
            raise CommandRefused(f"'get {what}'", "it does not know that", subject=self.subject)
        return answer.text

    async def get_if_known(self, what: str) -> str:
        """The same, and no words from a server that does not know ``what``."""
        return (await self._got(what)).text

    async def set(self, what: str, patience_s: float | None = None) -> None:
        """Have the controller do something; its acknowledgement is no proof that it did.

        Raises:
            CommandRefused: It says no; the reason is in its own words.
        """
        answer = await self.connection.ask(f"set {what}", patience_s)
        if not answer.accepted:
            raise await self._refusal(what, answer)

    async def pose(self) -> Pose:
        """The pose that the controller believes in, mm and deg, from the joints as they are."""
        return self._understood(parse_pose, await self.get("abs_act_pos"))

    async def joints(self) -> tuple[float, ...]:
        """The six joints as they are, mm."""
        return self._understood(parse_positions, await self.get("joint_pos"))

    async def all_homed(self) -> bool:
        """Whether every joint is homed."""
        homed = parse_homed(await self.get("joint_homed"))
        return bool(homed) and all(homed)

    async def is_on(self, what: str) -> bool:
        """Whether ``estop`` or ``machine`` is on."""
        return (await self.get(what)).upper() == "ON"

    async def errors(self) -> list[str]:
        """What the controller has to complain about, oldest first; the queue is empty afterwards.

        It holds what came before as well: whoever starts something anew empties it first.
        """
        found: dict[str, None] = {}
        for _ in range(_MOST_ERRORS):
            if (text := await self.get("error")).upper() == "OK":
                break
            found[text] = None
        return list(found)

    async def reason(self, remarks: tuple[str, ...] = ()) -> str:
        """Why something did not happen: the controller's complaints, or the state that it is in."""
        complaints = [*remarks, *await self.errors()]
        if len(complaints) > _MOST_TOLD:
            complaints[_MOST_TOLD:] = [f"and {len(complaints) - _MOST_TOLD} more"]
        return "; ".join(complaints) or await self._state()

    async def _got(self, what: str) -> Response:
        # LinuxCNC 2.9 reads the commands of all clients with one strtok(): two that speak at the same
        # moment garble each other's. A question can be asked again; an order is left to the caller.
        answer = await self.connection.ask(f"get {what}")
        return answer if answer.accepted else await self.connection.ask(f"get {what}")

    async def _refusal(self, what: str, answer: Response) -> CommandRefused:
        if (await self.get_if_known("enable")).upper() == "OFF":
            return CommandRefused(
                f"'set {what}'",
                "another client has taken control of it",
                subject=self.subject,
                action="See that nobody else moves the robot, then prepare it again",
            )
        return CommandRefused(f"'set {what}'", await self.reason(answer.explanations), subject=self.subject)

    async def _state(self) -> str:
        if await self.is_on("estop"):
            return "it is in emergency stop"
        return "it is on, and gives no reason" if await self.is_on("machine") else "it is switched off"

    def _understood(self, parse: Callable[[str], T], text: str) -> T:
        try:
            return parse(text)
        except ValueError as error:
            raise DeviceError(str(error), subject=self.subject) from error
