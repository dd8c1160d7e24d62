"""The links to one program, one after another; one that broke is replaced by one to the same controller."""

import asyncio
from collections.abc import Callable

from drivers.controllers.adapter.link import Link, Timeouts
from drivers.controllers.adapter.options import Program
from drivers.errors import ConnectionLost
from drivers.interfaces import DeviceIdentity
from drivers.wire_trace import TraceRecorder
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import AXES


class Session:
    """Opens, replaces and closes the link; ``on_replaced`` is called when there is to be another one."""

    def __init__(
        self,
        program: Program,
        settings: ControllerSettings,
        timeouts: Timeouts,
        trace: TraceRecorder | None,
        on_replaced: Callable[[], None],
    ) -> None:
        self._program, self._timeouts, self._trace = program, timeouts, trace
        self._on_replaced = on_replaced
        port = settings.port
        self._told: dict[str, object] = {"host": settings.host, **({} if port is None else {"port": port})}
        if settings.coordinates != AXES:
            self._told["coordinates"] = settings.coordinates
        self._is_open = False
        self._link: Link | None = None
        self._identity: DeviceIdentity | None = None
        self._linking = asyncio.Lock()

    async def open(self) -> DeviceIdentity:
        """Start the program, or connect to it.

        Raises:
            DeviceError: it is not there, ends, does not answer, or not as the protocol has it.
        """
        was_open, self._is_open = self._is_open, True
        try:
            await self.linked(self._timeouts.connect)
        except BaseException:
            self._is_open = was_open
            raise
        assert self._identity is not None  # noqa: S101 - of the link
        return self._identity

    async def close(self) -> None:
        """End the program, or the connection to it; closing twice is harmless."""
        self._is_open, self._identity = False, None
        link, self._link = self._link, None
        if link is not None:
            await link.close()

    def connected(self) -> Link:
        """The link as it is; raises what broke it."""
        self._require_open()
        if self._link is None:
            action = "Prepare it again"
            raise ConnectionLost("is not connected any more", subject=self._program.name, action=action)
        self._link.require_sound()
        return self._link

    async def linked(self, hello_s: float) -> Link:
        """The link; another one in place of one that broke, after which it must be prepared."""
        async with self._linking:
            self._require_open()
            if self._link is None or self._link.is_broken:
                if self._link is not None:
                    await self._link.close()
                self._on_replaced()
                self._link = await Link.open(
                    self._program, self._timeouts, self._trace, hello_s, **self._told
                )
                said = self._link.hello
                identity = DeviceIdentity(
                    name=self._program.name,
                    protocol=self._program.protocol,
                    description=", ".join(filter(None, (said.name, said.description))),
                    serial_number=said.serial_number,
                )
                if not self._is_open or identity != (self._identity or identity):
                    self._link.fail(f"is another one now: {identity.description}")
                    self._require_open()
                self._identity = self._identity or identity
            self._link.require_sound()
            return self._link

    async def relinked(self) -> Link:
        """Another link, as soon as a controller that may be restarting can be reached."""
        self.fail("was started anew")
        now = asyncio.get_running_loop().time
        deadline = now() + self._timeouts.reconnect
        while True:
            try:
                return await self.linked(self._timeouts.connect)
            except ConnectionLost:
                if now() > deadline:
                    raise
                await asyncio.sleep(self._timeouts.poll)

    def fail(self, problem: str) -> None:
        """Break the link, if there is one."""
        if self._link is not None:
            self._link.fail(problem)

    def _require_open(self) -> None:
        if not self._is_open:
            raise DeviceError("is not connected", subject=self._program.name, action="Open it first")
