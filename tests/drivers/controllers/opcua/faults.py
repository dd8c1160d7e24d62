"""What PLCs do wrong while the robot moves, and what is told of it."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from math import nan
from typing import Any

from asyncua import ua
from asyncua.ua.status_codes import StatusCodes

from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.opcua.program import Plc
from tests.drivers.controllers.opcua.plc import CYCLE_S, VT, PlcServer
from tests.waiting import wait_until

FAR, NEAR = (0.0, 0.0, 500.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 5.0)


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


def _rests(plc: PlcServer) -> bool:
    before = plc.machine.pose()
    threading.Event().wait(CYCLE_S)
    return plc.machine.pose() == before


def repair(plc: PlcServer) -> None:
    """End all faults; the emergency stop stays."""
    plc.forced.clear()
    plc.stands = False
    plc.set_silent(on=False)
    plc.set_unplugged(on=False)


@contextmanager
def prepared(plc: PlcServer) -> Iterator[Plc]:
    """A client that has made it ready to move."""
    client = Plc()
    client.hello({"settings": plc.options.model_dump(mode="json")})
    try:
        for action in ("reset-estop", "switch-on", "home"):
            client.start_up(action)
        yield client
    finally:
        client.close()


def moved_in_spite_of(
    plc: PlcServer, fault: PlcFault, duration_s: float, after_s: float | None = None
) -> str:
    """What is told of a fault at a moment of a move, by default its begin; empty if it was done before.

    The robot rests then, where it has told to be if it was done; nothing moves it until it is made ready.
    """
    told = ""
    with prepared(plc) as client, ThreadPoolExecutor(1) as pool:
        move = pool.submit(client.move, FAR, duration_s, lambda _: None)
        if after_s is None:
            wait_until(lambda: bool(plc.program.outputs["moving"]))
        threading.Event().wait(after_s or 0.0)
        fault.inject(plc)
        try:
            move.result()
        except FailedError as failure:
            told = str(failure)
        else:
            assert astuple(plc.machine.pose()) == FAR
        if NO_LINK in told:  # what was on its way may begin yet, until the PLC misses its client
            wait_until(lambda: plc.program.is_late)
        wait_until(lambda: plc.stands or not plc.program.outputs["moving"])
        wait_until(lambda: _rests(plc))  # what was stopped may take one more step
        at_rest = plc.machine.pose()
        repair(plc)
    with prepared(plc) as client:
        assert plc.machine.pose() == at_rest
        client.move(NEAR, 0.01, lambda _: None)
        assert astuple(plc.machine.pose()) == NEAR
    return told
