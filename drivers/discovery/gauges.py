"""Which dial indicators answer on a serial port: each protocol asks as it does when it is opened."""

from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, replace

from drivers.errors import (
    EmptyChannel,
    GaugeAtEnd,
    GaugeSilent,
    PortLost,
    WrongAnswer,
    WrongSetting,
    ZeroVoid,
)
from drivers.gauges.uwave import UwaveGauge, channel_of
from drivers.gauges.visa import IDENTIFY, VisaGauge, VisaPort
from drivers.interfaces import Gauge
from drivers.serial.port import NoAnswer, SerialPort
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, HexacellError

TIMEOUT_S = 0.5
UWAVE = "uwave"
HEIDENHAIN = "heidenhain-nd"
"""Asked last: an instrument that waits for the end of a line adds this question to the next one."""
BAUD_RATES = (9600, 115200)
DESCRIBE_QUESTION = 'Say what it is asked with protocol = "visa" (docs/drivers.md)'
DESCRIBE = 'Describe its lines with protocol = "stream" (docs/drivers.md)'

OTHER_BAUD_RATES = {"mux10": (19200, 4800, 2400, 38400, 57600, 115200)}
"""Of instruments that come set to others than their protocol's usual one."""

CHANNELS = range(1, 5)
"""Inputs of a multiplexer that are tried."""

GaugeFactory = Callable[[GaugeSettings, SharedSerialPorts], Gauge]


@dataclass(frozen=True, slots=True)
class FoundGauge:
    """A gauge that answers.

    Attributes:
        channel: its input of a multiplexer; none if it has the port alone.
        shown: what it shows, as it sent it; empty if it cannot be used as it is.
        problem: why it cannot be used as it is, with what to do.
        baudrate: of its line, where it is not that of its protocol.
    """

    protocol: str
    port: str
    description: str
    channel: int | None = None
    shown: str = ""
    problem: str = ""
    baudrate: int | None = None


@dataclass(frozen=True, slots=True)
class PortFindings:
    """What is on a port: its gauges, or why it could not be opened.

    ``heard`` is what was said of the last answer that no protocol understands, where none does.
    """

    port: str
    gauges: tuple[FoundGauge, ...] = ()
    problem: str = ""
    heard: str = ""


async def search_port(port: str, factories: Mapping[str, GaugeFactory]) -> PortFindings:
    """Ask in every protocol, then listen; the first that is answered is the port's."""
    if VISA_SEPARATOR in port:
        return await _identify(port)
    heard: list[str] = []
    for protocol, baudrate in _tries(factories):
        try:
            found = await _channels(protocol, factories[protocol], port, baudrate, heard)
        except HexacellError as error:
            return PortFindings(port, problem=f"{error.problem}. {error.action}")
        if found:
            return PortFindings(port, tuple(found))
    listened = await _listen(port, factories.get(UWAVE))
    return replace(listened, heard=heard[-1]) if heard and not listened.gauges else listened


def _tries(protocols: Collection[str]) -> Iterator[tuple[str, int | None]]:
    """Protocols in the order in which they are tried, with a baud rate where it is not the usual one."""
    asked = sorted(set(protocols) - {UWAVE}, key=lambda name: (name == HEIDENHAIN, name))
    yield from ((protocol, None) for protocol in asked)
    for protocol, rates in OTHER_BAUD_RATES.items():
        if protocol in asked:
            yield from ((protocol, rate) for rate in rates)


async def _identify(resource: str) -> PortFindings:
    """The instrument with VISA."""
    try:
        answer = await asyncio.to_thread(visa_identification, resource)
    except HexacellError as error:
        return PortFindings(resource, problem=f"{error.problem}. {error.action}")
    return PortFindings(resource, problem=f"is {answer}. {DESCRIBE_QUESTION}" if answer else "")


async def _listen(port: str, uwave: GaugeFactory | None) -> PortFindings:
    """What sends by itself."""
    channels = await asyncio.to_thread(uwave_channels, port)
    if channels and uwave is not None:
        return PortFindings(port, tuple([await _ask(UWAVE, uwave, port, channel) for channel in channels]))
    for baudrate in BAUD_RATES:
        if text := await asyncio.to_thread(a_number, port, baudrate):
            return PortFindings(port, problem=f"sends {text!r} by itself at {baudrate} baud. {DESCRIBE}")
    return PortFindings(port)


async def _channels(
    protocol: str, factory: GaugeFactory, port: str, baudrate: int | None, heard: list[str]
) -> list[FoundGauge]:
    """The gauges that answer in one protocol; raises ``PortLost`` where the port cannot be used.

    What is said of an answer that is none of the protocol is added to ``heard``.
    """
    found = []
    for channel in CHANNELS:
        try:
            gauge = await _ask(protocol, factory, port, channel, baudrate)
        except EmptyChannel:
            continue
        except GaugeSilent:
            break
        except WrongAnswer as error:
            heard.append(error.problem)
            break
        found.append(gauge)
        if gauge.channel is None:
            break
    return found


async def _ask(
    protocol: str, factory: GaugeFactory, port: str, channel: int, baudrate: int | None = None
) -> FoundGauge:
    serial = {} if baudrate is None else {"baudrate": baudrate}
    settings = GaugeSettings(
        name="x",
        axis="x",
        protocol=protocol,
        port=port,
        serial=serial,
        channel=channel,
        timeout_s=TIMEOUT_S,
    )
    ports = SharedSerialPorts(worst_latency_s=TIMEOUT_S)
    gauge = factory(settings, ports)
    its_channel = getattr(gauge, "channel", None)
    try:
        identity = await gauge.open()
        shown = (await gauge.read_once()).raw
    except (WrongSetting, GaugeAtEnd, ZeroVoid) as error:  # it answered
        told = f"{error.problem}. {error.action}"
        return FoundGauge(protocol, port, "", its_channel, "", told, baudrate)
    except (GaugeSilent, WrongAnswer, PortLost):
        raise
    except DeviceError as error:
        raise WrongAnswer(error.problem) from error
    finally:
        await gauge.close()
        await ports.close()
    return FoundGauge(protocol, port, identity.description, its_channel, shown, "", baudrate)


LISTEN_S = 1.0
NUMBER = re.compile(rb"[ -~]*\d\.\d[ -~]*")


def uwave_channels(port: str) -> tuple[int, ...]:
    """The channels whose values come on a port, as from a U-WAVE receiver."""
    channels = (channel_of(frame) for frame in _heard(port, UwaveGauge.spec.line.baudrate))
    return tuple(sorted({channel for channel in channels if channel is not None}))


def a_number(port: str, baudrate: int) -> str:
    """A line with a number that comes on a port; empty if none does."""
    numbers = (frame for frame in _heard(port, baudrate) if NUMBER.fullmatch(frame))
    return next(numbers, b"").decode("ascii")


def _heard(port: str, baudrate: int) -> Iterator[bytes]:
    """Whole lines: the first may be part of one."""
    line = SerialPort(port, {"baudrate": baudrate}, threading.Event())
    with closing(line), suppress(HexacellError):
        line.open()
        end_s = line.now() + LISTEN_S
        while line.now() < end_s:
            line.listen()
        yield from (frame.data for frame in line.log.after(1))


VISA_TIMEOUT_S = 2.0
VISA_SEPARATOR = "::"
"""In every VISA resource, and in no port."""


def visa_identification(resource: str) -> str:
    """What it answers to ``*IDN?``; empty if nothing.

    Raises:
        HexacellError: PyVISA is not installed, or the resource cannot be opened.
    """
    port = VisaPort(resource, {}, threading.Event())
    with closing(port):
        port.open()
        try:
            answer = port.exchange(IDENTIFY, VisaGauge.terminator, VISA_TIMEOUT_S)
        except NoAnswer:
            return ""
    return answer.decode("ascii", "replace").strip()
