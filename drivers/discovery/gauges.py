"""Which dial indicators answer on a serial port: each protocol is asked as its :class:`Probe` says."""

import asyncio
import re
import threading
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, replace

from drivers import errors
from drivers.discovery import USUAL, SearchTimeouts
from drivers.gauges.protocol import Probe
from drivers.gauges.visa import IDENTIFY, VisaGauge, line_to
from drivers.interfaces import Gauge
from drivers.serial.port import SerialPort
from drivers.serial.received import SHOWN_BYTES, is_text, quoted
from drivers.serial.request_port import FrameLog, NoAnswer
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, HexacellError
from hexacell.plugins import plugin_failures_named

LISTENED_BAUD_RATES = (9600, 115200)
"""Rates at which a port is listened to for numbers, where no protocol answers."""
CHANNELS = range(1, 5)
"""Inputs of a multiplexer that are tried."""
VISA_SEPARATOR = "::"
"""In every VISA resource, and in no port."""
NUMBER = re.compile(rb"[ -~]*\d\.\d[ -~]*")
DESCRIBE_QUESTION = 'Say what it is asked with protocol = "visa" (docs/drivers.md)'
DESCRIBE = 'Describe its lines with protocol = "stream" (docs/drivers.md)'

GaugeFactory = Callable[[GaugeSettings, SharedSerialPorts], Gauge]


@dataclass(frozen=True, slots=True)
class FoundGauge:
    """A gauge that answers.

    Attributes:
        channel: its input of a multiplexer; None if it has the port alone.
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

    ``heard`` describes the last answer that no protocol understands, where none does.
    """

    port: str
    gauges: tuple[FoundGauge, ...] = ()
    problem: str = ""
    heard: str = ""


def probe_of(factory: GaugeFactory) -> Probe | None:
    """How a search finds gauges of a driver; None if it must not ask them."""
    probe: Probe | None = getattr(factory, "probe", Probe())
    return probe


async def search_port(
    port: str, factories: Mapping[str, GaugeFactory], timeouts: SearchTimeouts = USUAL
) -> PortFindings:
    """Ask in every protocol, then listen; the first that is answered is the port's.

    That is a serial port, a pyserial URL, or a VISA resource, which is asked its name.
    """
    if VISA_SEPARATOR in port:
        return await _identify(port, timeouts)
    probes = {name: probe for name in factories if (probe := probe_of(factories[name])) is not None}
    asked = sorted(name for name, probe in probes.items() if probe.channel_of is None)
    last = sorted(asked, key=lambda name: probes[name].is_last)
    tries: list[tuple[str, int | None]] = [(name, None) for name in last]
    tries += [(name, rate) for name in asked for rate in probes[name].other_baud_rates]
    heard: list[str] = []
    for protocol, baudrate in tries:
        settings = _settings(protocol, port, timeouts.gauge, baudrate)
        settings = settings.model_copy(update={"settle_s": timeouts.restart * probes[protocol].restarts})
        try:
            with plugin_failures_named():
                found = await _channels(factories[protocol], settings, heard)
        except HexacellError as error:
            return PortFindings(port, problem=f"{error.problem}. {error.action}")
        if found:
            return PortFindings(port, tuple(found))
    listened = await _listen(port, factories, probes, timeouts)
    return replace(listened, heard=heard[-1]) if heard and not listened.gauges else listened


def _settings(protocol: str, port: str, timeout_s: float, baudrate: int | None = None) -> GaugeSettings:
    serial = {} if baudrate is None else {"baudrate": baudrate}
    return GaugeSettings(
        name="searched", axis="x", protocol=protocol, port=port, serial=serial, timeout_s=timeout_s
    )


async def _identify(resource: str, timeouts: SearchTimeouts) -> PortFindings:
    """The instrument at a VISA resource."""
    settings = {"settle_s": timeouts.restart}

    def name() -> str:
        line, address = line_to(resource)
        with closing(line(address, settings, threading.Event())) as port, suppress(NoAnswer):
            port.open()
            answer = port.exchange(IDENTIFY + VisaGauge.terminator, VisaGauge.terminator, timeouts.visa)
            return answer.decode("ascii", "replace").strip()
        return ""

    try:
        answer = await asyncio.to_thread(name)
    except HexacellError as error:
        return PortFindings(resource, problem=f"{error.problem}. {error.action}")
    return PortFindings(resource, problem=f"is {answer}. {DESCRIBE_QUESTION}" if answer else "")


async def _listen(
    port: str, factories: Mapping[str, GaugeFactory], probes: Mapping[str, Probe], timeouts: SearchTimeouts
) -> PortFindings:
    """What sends by itself: gauges of a protocol, else any number."""
    heard = ""
    for protocol, probe in probes.items():
        if (channel_of := probe.channel_of) is not None:
            rate = factories[protocol].spec.line.baudrate  # type: ignore[attr-defined]
            log = await asyncio.to_thread(_log, port, rate, timeouts)
            frames = [frame.data for frame in log.after(1)]
            channels = {channel for frame in frames if (channel := channel_of(frame)) is not None}
            if channels:
                settings = _settings(protocol, port, timeouts.gauge)
                found = [await _ask(factories[protocol], settings, channel) for channel in sorted(channels)]
                return PortFindings(port, tuple(found))
    for baudrate in LISTENED_BAUD_RATES:
        log = await asyncio.to_thread(_log, port, baudrate, timeouts)
        for frame in log.after(1):
            if NUMBER.fullmatch(frame.data):
                text = frame.data.decode("ascii")
                problem = f"sends {text!r} by itself at {baudrate} baud. {DESCRIBE}"
                return PortFindings(port, problem=problem)
        if log.latest and (not heard or is_text(log.latest)):
            heard = f"sends {quoted(log.latest[-SHOWN_BYTES:])} by itself at {baudrate} baud"
    return PortFindings(port, heard=heard)


def _log(port: str, baudrate: int, timeouts: SearchTimeouts) -> FrameLog:
    """What comes within some time, of which the first line may be part of one."""
    line = SerialPort(port, {"baudrate": baudrate}, threading.Event())
    with closing(line), suppress(HexacellError):
        line.open()
        end_s = line.now() + timeouts.listen
        while line.now() < end_s + (0.0 if line.log.pieces else timeouts.restart):
            line.listen()
    return line.log


async def _channels(factory: GaugeFactory, settings: GaugeSettings, heard: list[str]) -> list[FoundGauge]:
    """The gauges that answer in one protocol; raises ``PortLost`` where the port cannot be used.

    Why an answer is of another protocol is added to ``heard``.
    """
    found = []
    for channel in CHANNELS:
        try:
            gauge = await _ask(factory, settings, channel)
        except errors.EmptyChannel:
            continue
        except errors.GaugeSilent:
            break
        except errors.WrongAnswer as error:
            heard.append(error.problem)
            break
        found.append(gauge)
        if gauge.channel is None:
            break
    return found


async def _ask(factory: GaugeFactory, settings: GaugeSettings, channel: int) -> FoundGauge:
    ports = SharedSerialPorts(worst_latency_s=settings.timeout_s)
    gauge = factory(settings.model_copy(update={"channel": channel}), ports)
    baudrate = settings.serial.get("baudrate")
    own_channel = getattr(gauge, "channel", None)
    found = FoundGauge(settings.protocol, settings.port or "", "", own_channel, baudrate=baudrate)
    try:
        identity = await gauge.open()
        shown = (await gauge.read_once()).raw
    except (errors.WrongSetting, errors.GaugeAtEnd, errors.ZeroVoid) as error:  # it answered
        return replace(found, problem=f"{error.problem}. {error.action}")
    except (errors.GaugeSilent, errors.WrongAnswer, errors.PortLost):
        raise
    except DeviceError as error:
        raise errors.WrongAnswer(error.problem) from error
    finally:
        await gauge.close()
        await ports.close()
    return replace(found, description=identity.description, shown=shown)
