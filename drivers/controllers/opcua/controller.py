"""The driver of a PLC: the adapter's, with the program that speaks OPC UA."""

from typing import cast

from drivers.controllers.adapter.controller import AdapterController, Timeouts
from drivers.controllers.adapter.options import Program
from drivers.controllers.opcua.options import OpcUaOptions
from drivers.errors import optional
from drivers.wire_trace import TraceRecorder
from hexacell.cell.robot import ControllerSettings
from hexacell.python_process import python_command

_TIMEOUTS = Timeouts()


class OpcUaController(AdapterController):
    """``drivers.interfaces.Controller`` of a PLC with an OPC UA server."""

    Options = OpcUaOptions  # type: ignore[assignment]

    def __init__(
        self,
        settings: ControllerSettings,
        *,
        trace: TraceRecorder | None = None,
        timeouts: Timeouts = _TIMEOUTS,
    ) -> None:
        options = cast("OpcUaOptions", settings.options)
        name = f"controller {options.endpoint}"
        optional("asyncua", "opcua", name)
        command = python_command("drivers.controllers.opcua.program")
        told = options.model_dump(mode="json")
        super().__init__(
            settings,
            Program(name, command, settings=told, protocol="opcua"),
            trace=trace,
            timeouts=timeouts,
        )
