"""What PLCs do wrong while the robot moves, and what is told of it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from typing import Any

from asyncua import ua
from asyncua.ua.status_codes import StatusCodes

from tests.drivers.controllers.opcua.plc import VT, PlcServer


@dataclass(frozen=True)
class PlcFault:
    """A fault, and words of what is told."""

    name: str
    inject: Callable[[PlcServer], object]
    told: str


def _forced(
    name: str, value: Any, kind: ua.VariantType = VT.Null, status: int = 0
) -> Callable[[PlcServer], object]:
    data = ua.DataValue(ua.Variant(value, kind), ua.StatusCode(ua.UInt32(status)))
    return lambda plc: plc.forced.update({name: data})


def _old_number(plc: PlcServer) -> None:
    plc.forced["answered"] = ua.DataValue(ua.Variant(plc.program.outputs["answered"] - 1, VT.Int16))


NO_LINK = "no connection to the PLC"
FAULTS = (
    PlcFault(
        "bad status", _forced("moving", None, status=StatusCodes.BadSensorFailure), "BadSensorFailure"
    ),
    PlcFault(
        "old value", _forced("pose", [0.0] * 6, VT.Double, StatusCodes.UncertainLastUsableValue), "not Good"
    ),
    PlcFault("NaN", _forced("pose", [nan] * 6, VT.Double), "is not six finite reals"),
    PlcFault("five joints", _forced("joints", [0.0] * 5, VT.Double), "is not six finite reals"),
    PlcFault("wrong type", _forced("busy", 1, VT.Int16), "is not true or false"),
    PlcFault("no value", _forced("heartbeat", None), "is not an integer"),
    PlcFault("old number", _old_number, "answers command"),
    PlcFault("done too early", _forced("done", True, VT.Boolean), "says done, but is busy or moves"),
    PlcFault("gives up", _forced("busy", False, VT.Boolean), "neither done nor error"),
    PlcFault("frozen heartbeat", _forced("heartbeat", 7, VT.Int16), "program stands"),
    PlcFault("in STOP", PlcServer.stand, "program stands"),
    PlcFault("quits", lambda plc: plc.set_unplugged(on=True), NO_LINK),
    PlcFault("silent", lambda plc: plc.set_silent(on=True), NO_LINK),
    PlcFault("restart", PlcServer.restart, NO_LINK),
    PlcFault("emergency stop", lambda plc: plc.program.press_estop(), "emergency stop"),
    PlcFault(
        "another's number",
        lambda plc: plc.write(number=4711 ^ plc.program.outputs["answered"]),
        "another client",
    ),
    PlcFault("another's counter", lambda plc: plc.write(client_heartbeat=-1), "another client"),
    PlcFault("another's edge", lambda plc: plc.write(execute=False), "another client"),
)


def repair(plc: PlcServer) -> None:
    """End all faults; the emergency stop stays."""
    plc.forced.clear()
    plc.stands = False
    plc.set_silent(on=False)
    plc.set_unplugged(on=False)
