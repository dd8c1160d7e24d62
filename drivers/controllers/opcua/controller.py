"""The driver of a PLC: the adapter's, with the program that speaks OPC UA."""

from typing import Any, cast

from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.options import Program
from drivers.controllers.opcua.options import OpcUaOptions
from drivers.errors import optional
from hexacell.cell.robot import ControllerOptions, ControllerSettings
from hexacell.errors import UsageError
from hexacell.kinematics.pose import AXES
from hexacell.python_process import python_command


class OpcUaController(AdapterController):
    """``drivers.interfaces.Controller`` of a PLC with an OPC UA server."""

    Options: type[ControllerOptions] = OpcUaOptions

    def __init__(self, settings: ControllerSettings, **named: Any) -> None:  # noqa: ANN401 - its base's
        options = cast("OpcUaOptions", settings.options)
        name, told = f"controller {options.endpoint}", options.model_dump(mode="json")
        optional("asyncua", "opcua", name)
        if settings.coordinates != AXES:
            action = "Use another protocol, as adapter"
            raise UsageError(f"a PLC takes {AXES}, and the robot has {settings.coordinates}", action=action)
        command = python_command("drivers.controllers.opcua.program")
        super().__init__(settings, Program(name, command, settings=told, protocol="opcua"), **named)
