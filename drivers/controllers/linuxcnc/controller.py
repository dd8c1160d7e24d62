"""The drivers of LinuxCNC, by its network shell and by its Python module: the adapter's, before either."""

from pathlib import Path
from typing import cast

from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.link import Link, Timeouts
from drivers.controllers.adapter.local_program import LocalRobot
from drivers.controllers.adapter.messages import Status
from drivers.controllers.adapter.options import Program
from drivers.controllers.linuxcnc.machine import Machine
from drivers.controllers.linuxcnc.shell_access import ShellAccess
from drivers.controllers.linuxcnc.shell_protocol import Limits
from drivers.errors import CommandRefused
from drivers.wire_trace import LineRecord, TraceRecorder
from hexacell.cell.fields import Text, key
from hexacell.cell.robot import ControllerOptions, ControllerSettings
from hexacell.errors import DeviceError, UsageError

_LIMITS = Limits()
_TIMEOUTS = Timeouts(answer=8.0, command=25.0)
"""Longer than those of the shell, which says more of what does not answer."""


class LinuxcncController(AdapterController):
    """What both have in common: coordinates are checked, and an emergency stop leaves it homed."""

    async def check(self) -> None:
        """Check that its coordinates are those of the machine, in control of it; nothing moves.

        Raises:
            DeviceError: Units, offsets, modal codes or the feed override make moves other than commanded.
        """
        async with self._order:
            await self._check(self._session.connected())

    async def _check(self, link: Link) -> None:
        try:
            await self._do(link, "check", self._timeouts.answer)
        except CommandRefused as found:
            raise DeviceError(found.reason, subject=self._name, action=found.action) from found

    async def _undisturbed(self, link: Link) -> Status:
        status = await super()._undisturbed(link)
        await self._check(link)
        return status

    def _is_later_estop(self, status: Status) -> bool:
        return status.homed


class _Shell(Machine):
    def __init__(self, access: ShellAccess) -> None:
        super().__init__(access)
        self.close = access.close


class LinuxcncrshController(LinuxcncController):
    """``drivers.interfaces.Controller`` by linuxcncrsh, over TCP."""

    Options: type[ControllerOptions] = ControllerOptions
    converts_units = True

    def __init__(
        self,
        settings: ControllerSettings,
        *,
        trace: TraceRecorder | None = None,
        timeouts: Timeouts = _TIMEOUTS,
        limits: Limits = _LIMITS,
    ) -> None:
        if settings.port is None:
            raise UsageError("the cell file names no controller port", action="Set controller.port")
        name = f"controller {settings.host}:{settings.port}"

        def robot() -> LocalRobot:
            return _Shell(ShellAccess(settings, limits, LineRecord(name, trace)))

        program = Program(name, robot=robot, protocol="linuxcncrsh")
        super().__init__(settings, program, timeouts=timeouts)


class LinuxcncOptions(ControllerOptions):
    """The interpreter that has LinuxCNC's module."""

    python: Text = key("/usr/bin/python3", "Python that can import linuxcnc, as that of the system")


class LinuxcncModuleController(LinuxcncController):
    """``drivers.interfaces.Controller`` by LinuxCNC's Python module: a program under LinuxCNC's Python."""

    Options: type[ControllerOptions] = LinuxcncOptions

    def __init__(self, settings: ControllerSettings, *, trace: TraceRecorder | None = None) -> None:
        python = cast("LinuxcncOptions", settings.options).python
        command = (python, "-u", str(Path(__file__).with_name("module_program.py")))
        program = Program("controller LinuxCNC", command, protocol="linuxcnc")
        super().__init__(settings, program, trace=trace)
