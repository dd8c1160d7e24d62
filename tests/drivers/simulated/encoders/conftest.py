"""A simulated bank with positions that show which sample they belong to, and ways to reach it."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

import can
import pytest
from canopen.objectdictionary.datatypes import UNSIGNED8

from drivers.encoders.cia406 import Cia406Bank
from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.encoders.object_dictionary import TPDO_OFF, DeviceData, Row, TpdoDefaults, Vendor
from drivers.simulated.serial_line import PtyLine, SerialLine, SocketLine
from drivers.simulated.slcan import SlcanServer
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.clock import CellClock


@pytest.fixture(autouse=True)
def no_nap_after_closing_a_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    """pyserial's ``socket://`` sleeps 0.3 s after closing, for the sake of slow servers."""
    awake = SimpleNamespace(sleep=lambda _seconds: None)
    monkeypatch.setattr("serial.urlhandler.protocol_socket.time", awake)


class Samples:
    """Positions that are one count further at every sample, the same for all legs."""

    def __init__(self) -> None:
        self.taken = 0

    def __call__(self) -> list[float]:
        self.taken += 1
        return [self.taken * 0.001] * 6


LINES: dict[str, Callable[[], SerialLine]] = {"pty": lambda: PtyLine("slcan"), "socket": SocketLine}
"""Serial lines on which an slcan adapter may be."""

MakeBank = Callable[..., SimulatedEncoderBank]


@pytest.fixture
def samples() -> Samples:
    return Samples()


@pytest.fixture
def settings() -> LinearEncoderSettings:
    """The driver's time-outs are for silent nodes; a busy machine is not one."""
    return LinearEncoderSettings(timeout_s=10.0)


@pytest.fixture
def make_bank(settings: LinearEncoderSettings, samples: Samples) -> Iterator[MakeBank]:
    """Start a simulated bank; ends with the test."""
    with ExitStack() as stack:

        def make(**options: Any) -> SimulatedEncoderBank:
            chosen: dict[str, Any] = {
                "settings": settings,
                "positions": samples,
                "clock": CellClock(),
            } | options
            return stack.enter_context(SimulatedEncoderBank(**chosen))

        yield make


@pytest.fixture(params=["virtual", "pty", "socket"])
def reach(request: pytest.FixtureRequest) -> Iterator[Callable[[SimulatedEncoderBank], dict[str, Any]]]:
    """Settings for ``can.Bus`` to reach a bank inside this process, by a pty, or by a socket."""
    with ExitStack() as stack:

        def reach(bank: SimulatedEncoderBank) -> dict[str, Any]:
            if request.param == "virtual":
                return bank.bus_settings
            line = LINES[request.param]()
            return stack.enter_context(SlcanServer(bank.channel, line)).bus_settings

        yield reach


@pytest.fixture
async def driver(settings):
    """Make drivers for a bus; they are closed with the test."""
    drivers: list[Cia406Bank] = []

    def make(bus: dict[str, Any], **changes: Any) -> Cia406Bank:
        drivers.append(Cia406Bank(settings.model_copy(update={"bus": bus, **changes})))
        return drivers[-1]

    yield make
    for each in drivers:
        await each.close()


ASKED, REACHED = 0x7F0, 0x7F1
"""Unused identifiers."""


class Listener:
    """A bare connection to the bus of a simulated bank."""

    def __init__(self, bus: can.BusABC, bank: SimulatedEncoderBank) -> None:
        self.bus = bus
        bank.bus.subscribe(ASKED, lambda *_frame: bank.bus.send_message(REACHED, b""))

    def send(self, can_id: int, *data: int) -> None:
        self.bus.send(can.Message(arbitration_id=can_id, data=bytes(data), is_extended_id=False))

    def next(self) -> tuple[int, str]:
        """The next frame: (id, data in hexadecimal)."""
        message = self.bus.recv()
        assert message is not None
        return message.arbitration_id, bytes(message.data).hex()

    def heard(self) -> list[tuple[int, str]]:
        """Everything that comes until the bank has dealt with all that was sent so far."""
        self.send(ASKED)
        return list(iter(self.next, (REACHED, "")))

    def silence(self) -> bool:
        """Whether nothing comes for several periods of a timer."""
        return self.bus.recv(0.06) is None

    def wait_for(self, can_id: int) -> str:
        """The data of the next frame with an id, whatever else comes."""
        return next(data for heard_id, data in iter(self.next, None) if heard_id == can_id)

    def sdo(self, node: int, request: str) -> str:
        """The answer to an SDO request."""
        self.send(0x600 + node, *bytes.fromhex(request).ljust(8, b"\0"))
        return self.wait_for(0x580 + node)


@pytest.fixture
def listen() -> Iterator[Callable[[SimulatedEncoderBank], Listener]]:
    with ExitStack() as stack:

        def make(bank: SimulatedEncoderBank) -> Listener:
            return Listener(stack.enter_context(can.Bus(**bank.bus_settings)), bank)

        yield make


_POSITION = (0x6004, 0, 32)
_SPEED = (0x6030, 1, 16)
_MAGNET_1 = (0x6020, 1, 32)
_MAGNET_2 = (0x6020, 2, 32)


class _EventsOnly(Vendor):
    def objects(self, data: DeviceData) -> Iterator[Row]:
        for index, subindex, name, kind, value, access in super().objects(data):
            off = TPDO_OFF if (index, subindex) == (0x1801, 1) else 0
            if index != 0x6005:
                yield index, subindex, name, kind, value | off, access


class _TwoMagnets(Vendor):
    def objects(self, data: DeviceData) -> Iterator[Row]:
        for index, subindex, name, kind, value, access in super().objects(data):
            if index == 0x6004:
                yield 0x6020, 0, "number of magnets", UNSIGNED8, 2, "ro"
                yield from ((0x6020, magnet, f"magnet {magnet}", kind, 0, "ro") for magnet in (1, 2))
            else:
                yield index, subindex, name, kind, value, "ro" if 0x1A00 <= index < 0x1C00 else access


EVENTS_ONLY = _EventsOnly(
    device_type=0x0008_0196,
    tpdos=(
        TpdoDefaults((_POSITION,), transmission_type=254, event_timer_ms=1),
        TpdoDefaults((), transmission_type=1),
    ),
)
"""TPDO1 every millisecond, TPDO2 off and empty; the step is in 6501h."""

TWO_MAGNETS = _TwoMagnets(
    device_type=0x000A_0196,
    tpdos=(
        TpdoDefaults((_MAGNET_1, _SPEED), transmission_type=254, event_timer_ms=10),
        TpdoDefaults((_MAGNET_2, _MAGNET_1), transmission_type=1),
    ),
)
"""Positions in 6020h, and a fixed mapping in which the first magnet comes second."""
