"""The driver of a LinuxCNC on this computer: a program under LinuxCNC's Python, by the adapter protocol."""

from pathlib import Path
from typing import cast

from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.options import Program
from drivers.wire_trace import TraceRecorder
from hexacell.cell.fields import Text, key
from hexacell.cell.robot import ControllerOptions, ControllerSettings


class LinuxcncOptions(ControllerOptions):
    """The interpreter that has LinuxCNC's module."""

    python: Text = key("/usr/bin/python3", "Python that can import linuxcnc, as that of the system")


class LinuxcncController(AdapterController):
    """``drivers.interfaces.Controller`` by LinuxCNC's Python module."""

    Options: type[ControllerOptions] = LinuxcncOptions

    def __init__(self, settings: ControllerSettings, *, trace: TraceRecorder | None = None) -> None:
        python = cast("LinuxcncOptions", settings.options).python
        command = (python, "-u", str(Path(__file__).with_name("program.py")))
        super().__init__(
            settings, Program("controller LinuxCNC", command, protocol="linuxcnc"), trace=trace
        )
