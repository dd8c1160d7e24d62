"""Three gauges on lines of their own, and drivers that read them."""

import asyncio
import contextlib

from drivers.serial.shared_port import SharedSerialPort, SharedSerialPorts
from drivers.simulated.gauges.bank import SimulatedGaugeBank, instrument_class
from drivers.simulated.gauges.instruments import Indicator
from drivers.simulated.gauges.server import GaugeLineServer
from drivers.simulated.serial_line import PtyLine, SocketLine
from drivers.wire_trace import WireTrace
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import SimulatedGauges
from hexacell.clock import CellClock
from hexacell.plugins import Group, load

PROTOCOLS = ("sylvac", "mux10", "cdi")
DISPLAYS = ("mitutoyo-id-h", "heidenhain-nd", "keyence-dl-rs1a", "digimatic-usb")
DESCRIBED = ("uwave", "visa", "modbus", "request", "stream")
REQUEST = {
    "ask": "GA01\r\n",
    "answer": r"GN01,([+-]\d{4}\.\d{4})",
    "example": "GN01,+0016.2345\r\n",
    "at_end": "ERROR",
}
STREAM = {"answer": r"(?P<channel>\d\d):(?P<number>[+-]\d{3}\.\d{3})", "example": "01:+012.345\r\n"}


def described(protocol, number):
    """What the cell file has to say of the gauge with that number."""
    if protocol == "visa":
        expect = {"UNIT:LENG?": "M"}
        return {"visa": {"ask": "READ? (@{channel})", "mm_per_unit": 1000.0, "expect": expect}}
    if protocol == "modbus":
        place = {"register": 2 * number, "at_end": [0x7FFFFFFF]}
        # a pseudo-terminal refuses the parity of a port that is opened again
        return {"modbus": place}
    if protocol == "request":
        return {"request": REQUEST}
    if protocol == "stream":
        return {"stream": STREAM}
    return {}


STREAM_DELAY_S = 0.02
TRANSPORTS = ("pty", "socket")
FAST = 100.0
WORST_LATENCY_S = 0.6
LONG_S = 100.0


class Cell:
    """Three gauges x, y, z that see balls at 1, 2 and 3 mm, and drivers for them.

    ``stated``: what the cell file says of one, by its protocol and number.
    """

    def __init__(self, protocols, transport="pty", timeout_s=LONG_S, stated=described, **simulation):
        self.balls = {"x": 1.0, "y": 2.0, "z": 3.0}
        settings = [
            GaugeSettings(
                name=name,
                axis=name,
                protocol=protocol,
                channel=number,
                timeout_s=timeout_s,
                delay_s=STREAM_DELAY_S,
                **stated(protocol, number),
            )
            for number, (name, protocol) in enumerate(zip("xyz", protocols, strict=True), start=1)
        ]
        plungers = {name: lambda name=name: self.balls[name] for name in "xyz"}
        simulated = SimulatedGauges(transport=transport, **simulation)
        self.rack = SimulatedGaugeBank(settings, plungers, simulated, CellClock(FAST))
        self.trace = WireTrace()
        self.links = SharedSerialPorts(trace=self.trace, worst_latency_s=WORST_LATENCY_S)
        self.gauges = {
            each.name: load(Group.GAUGES, each.protocol)(each, self.links) for each in self.rack.gauges
        }

    async def open(self):
        await asyncio.gather(*(gauge.open() for gauge in self.gauges.values()))

    async def values(self):
        readings = await asyncio.gather(*(gauge.read() for gauge in self.gauges.values()))
        return [reading.value_mm for reading in readings]


@contextlib.asynccontextmanager
async def cell(*args, **kwargs):
    made = Cell(*args, **kwargs)
    try:
        yield made
    finally:
        await made.links.close()
        made.rack.close()


def served(protocol, plunger=lambda: 1.0, transport="pty", factor=FAST, name="gauge", **pace):
    instrument = instrument_class(protocol)({1: Indicator(plunger)})
    line = PtyLine(name) if transport == "pty" else SocketLine()
    return GaugeLineServer(instrument, line, CellClock(factor), **({"latency_s": 0.02} | pace))


@contextlib.asynccontextmanager
async def linked(line, **settings):
    """An open connection to a line."""
    link = SharedSerialPort(line.url, settings)
    try:
        await link.open()
        yield link
    finally:
        await link.close()


def questions_to(line):
    """A list that gets every question when it arrives at ``line``."""
    questions, answer = [], line.instrument.answer

    def noted(command):
        questions.append(command)
        return answer(command)

    line.instrument.answer = noted
    return questions


async def ask(link, question=b"?\r"):
    return await link.exchange(question, b"\r", LONG_S)
