"""Which CAN adapters are there, and what is on a bus; the node id of one device is set.

The bus is listened to for a while, for encoders that are not CANopen nodes; then each of 127 node ids is
asked. A node id is set by LSS (CiA 305), for an encoder that comes with another one. All devices in LSS
configuration state take the same id. So the device must be alone on the bus, and devices are counted
before anything is set.
"""

import re
import threading
from collections.abc import Collection, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
from canopen.lss import CS_INQUIRE_VENDOR_ID, LssError, LssMaster

from drivers.discovery import USUAL, SearchTimeouts
from drivers.encoders import object_dictionary as od
from drivers.encoders.can_bus import EncoderBus, advice_on, is_canopen
from drivers.encoders.canopen_node import EncoderNode, Leg
from drivers.encoders.object_dictionary import DeviceType
from drivers.errors import BusError
from drivers.serial.port import SerialPort
from drivers.serial.request_port import NoAnswer
from hexacell.errors import DeviceError, HexacellError
from hexacell.kinematics.parameters import JointUnit

SLCAN_LINE = {"baudrate": 115200}
SLCAN_QUESTIONS = (b"\rV\r", b"V\r")
"""Its version; the first line end ends, or repeats, what was asked before in another protocol."""
SLCAN_VERSION = re.compile(
    rb"[\a\n]*(?:V[0-9A-F]{4}|[0-9A-F]{7,40}\S* [ -~]*[./][ -~]*"
    rb"|[ -~]*(?:slcan|canable|cantact|candle|canusb|usb.?can|usbtin)[ -~]*)\r",
    re.IGNORECASE,
)
"""That of LAWICEL and their like, of a build by its hash and address, or one that names what it is."""
NETWORK_DEVICES = Path("/sys/class/net")
ARPHRD_CAN = "280"
"""The type of a CAN interface (linux/if_arp.h)."""
MAX_IDENTIFIERS = 64
"""Identifiers of frames that are kept: a vehicle's bus has some hundreds."""
NODE_SERVICES = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)
"""Identifiers to which a node adds its id (CiA 301, predefined connection set)."""
BROADCASTS = (0x000, 0x080, 0x100)
"""Identifiers of NMT, SYNC and TIME."""


@dataclass(frozen=True, slots=True)
class FoundNode:
    """A CANopen node that answers. ``step``: nm a count, or counts a turn; None if it is not reported."""

    node: int
    description: str
    serial_number: int | None = None
    step: int | None = None
    unit: JointUnit | None = None


@dataclass(frozen=True, slots=True)
class FoundFrame:
    """The frames with one identifier.

    Attributes:
        length: of the latest, bytes.
        per_second: how many came.
        changes: whether their data were not always the same.
    """

    identifier: int
    is_extended: bool
    length: int
    per_second: float
    changes: bool


@dataclass(frozen=True, slots=True)
class BusFindings:
    """What is on a bus, or why it cannot be used. ``frames`` came unasked, from no such node."""

    bus: Mapping[str, Any]
    nodes: tuple[FoundNode, ...] = ()
    frames: tuple[FoundFrame, ...] = ()
    problem: str = ""


class OverheardFrames:
    """What a bus says while it is only listened to: a filter of an :class:`EncoderBus`, which keeps it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._heard: dict[tuple[int, bool], tuple[bytes, int, bool]] = {}  # latest, how many, changes

    def accepts(self, message: can.Message) -> bool:
        """Keep a frame; whether it is one for a CANopen network."""
        if message.is_rx and not message.is_remote_frame:
            key, data = (message.arbitration_id, message.is_extended_id), bytes(message.data)
            with self._lock:
                if key in self._heard or len(self._heard) < MAX_IDENTIFIERS:
                    before, count, changes = self._heard.get(key, (data, 0, False))
                    self._heard[key] = data, count + 1, changes or data != before
        return is_canopen(message)

    def counted(self, seconds: float) -> tuple[FoundFrame, ...]:
        """The frames that were heard until now, in ``seconds``, by identifier."""
        with self._lock:
            return tuple(
                FoundFrame(*key, len(data), count / seconds, changes)
                for key, (data, count, changes) in sorted(self._heard.items())
            )


def frames_of_no_node(frames: Collection[FoundFrame], nodes: Collection[int]) -> tuple[FoundFrame, ...]:
    """The frames that these CANopen nodes do not send: of encoders with a DBC file, perhaps."""
    known = {service + node for service in NODE_SERVICES for node in nodes}
    known |= set(BROADCASTS if nodes else ())
    return tuple(one for one in frames if one.is_extended or one.identifier not in known)


def socketcan_interfaces() -> tuple[str, ...]:
    """The CAN interfaces of the kernel."""
    found = []
    for device in sorted(NETWORK_DEVICES.glob("*")):
        with suppress(OSError):
            if (device / "type").read_text().strip() == ARPHRD_CAN:
                found.append(device.name)
    return tuple(found)


def speaks_slcan(port: str, timeouts: SearchTimeouts = USUAL) -> bool:
    """Whether a CAN adapter with the slcan protocol answers on a serial port; it is asked its version."""
    line = SerialPort(port, SLCAN_LINE, threading.Event())
    with closing(line), suppress(HexacellError):
        line.open()
        for question in SLCAN_QUESTIONS:
            with suppress(NoAnswer):
                if SLCAN_VERSION.fullmatch(line.exchange(question, b"\r", timeouts.adapter)):
                    return True
    return False


def search_bus(bus: Mapping[str, Any], timeouts: SearchTimeouts = USUAL) -> BusFindings:
    """What sends unasked on a bus (settings for ``can.Bus``), and the nodes that answer, by node id."""
    overheard = OverheardFrames()
    try:
        with closing(EncoderBus(bus, threading.Event(), accepts=overheard.accepts)) as opened:
            try:
                opened.listen(timeouts.listen)
                frames = overheard.counted(timeouts.listen)
                ids = responding_nodes(opened, timeouts)
                nodes = tuple(_described(opened, node, timeouts.node) for node in ids)
            except BusError as error:
                action = advice_on(error.__cause__) or "Check cable and termination; try another bit rate"
                raise BusError(error.problem, subject=opened.name, action=action) from error
            return BusFindings(bus, nodes, frames_of_no_node(frames, ids))
    except HexacellError as error:
        return BusFindings(bus, problem=str(error))


def responding_nodes(bus: EncoderBus, timeouts: SearchTimeouts = USUAL) -> list[int]:
    """The nodes that respond to a question to each: until no further one does for a while."""
    scanner = bus.network.scanner
    scanner.search()
    bus.wait_for(lambda: bool(scanner.nodes), timeouts.adapter)
    while bus.wait_for(lambda known=set(scanner.nodes): set(scanner.nodes) != known, timeouts.node):  # type: ignore[misc]
        pass
    return sorted(set(scanner.nodes))


def _described(bus: EncoderBus, number: int, timeout_s: float) -> FoundNode:
    """What a node says of itself, or why it does not: the others are told all the same."""
    try:
        return _device(EncoderNode(Leg(0, number), bus, timeout_s), number)
    except BusError:
        raise
    except DeviceError as error:
        return FoundNode(number, f"it {error.problem}. {error.action}")


def _device(node: EncoderNode, number: int) -> FoundNode:
    kind = node.read_optional(od.DEVICE_TYPE)
    if kind not in set(DeviceType):
        profile = "" if kind is None else f", profile {kind & 0xFFFF}; encoders are {od.ENCODER_PROFILE}"
        return FoundNode(number, f"no encoder that is known{profile}")
    device = DeviceType(kind)
    entries = [od.UNITS_PER_TURN] if device.unit is JointUnit.DEG else [od.MEASURING_STEP_SETTING]
    steps = (node.read_optional(entry) for entry in (*entries, od.MEASURING_STEP))
    step = next((value for value in steps if value is not None), None)
    return FoundNode(number, device.description, node.read_optional(od.SERIAL_NUMBER), step, device.unit)


RESPONSES = 0x7E4
SECOND_RESPONSE_S = 0.1
"""How long a second device may take to answer the same question."""

_NMT, _RESET_COMMUNICATION = 0x000, bytes((0x82, 0))
ALONE = "Connect the one device whose node id is to be set, and no other"


def set_node_id(bus: Mapping[str, Any], node: int, timeouts: SearchTimeouts = USUAL) -> int | None:
    """Have the only device on a bus take a node id, 1 to 127, and keep it; the id that it had, if any.

    Raises:
        BusError: the bus cannot be opened, or has failed; or nothing has the id afterwards.
        DeviceError: there is no device, or more than one; it does not know LSS, or refuses the id.
    """
    with closing(EncoderBus(bus, threading.Event())) as opened:
        before = responding_nodes(opened, timeouts)
        if len(before) > 1:
            nodes = ", ".join(map(str, before))
            raise DeviceError(f"has several nodes: {nodes}", subject=opened.name, action=ALONE)
        master = opened.network.lss
        master.send_switch_state_global(master.CONFIGURATION_STATE)  # type: ignore[no-untyped-call]
        try:
            _require_alone(opened, master)
            master.configure_node_id(node)  # type: ignore[no-untyped-call]
            master.store_configuration()  # type: ignore[no-untyped-call]
        except LssError as error:
            raise DeviceError(
                f"has a device that refuses node id {node}: {error}",
                subject=opened.name,
                action="Set it with its vendor's tool",
            ) from error
        finally:
            master.send_switch_state_global(master.WAITING_STATE)  # type: ignore[no-untyped-call]
        opened.network.send_message(_NMT, _RESET_COMMUNICATION)
        opened.network.scanner.reset()  # type: ignore[no-untyped-call]
        if node not in responding_nodes(opened, timeouts):
            raise BusError(
                f"has no node {node} after it was stored",
                subject=opened.name,
                action="Switch the device off and on, and look: hexacell devices --can",
            )
        return before[0] if before else None


def _require_alone(bus: EncoderBus, master: LssMaster) -> None:
    """Also a device without a node id, which no search finds, answers what its vendor is."""
    answers: list[int] = []
    bus.network.subscribe(RESPONSES, lambda *_frame: answers.append(1))
    try:
        master.inquire_lss_address(CS_INQUIRE_VENDOR_ID)  # type: ignore[no-untyped-call]
    except LssError as error:
        raise DeviceError(
            f"has no device that knows LSS: {error}",
            subject=bus.name,
            action="Check supply, cable and bit rate, or set its node id with its vendor's tool",
        ) from error
    bus.listen(SECOND_RESPONSE_S)
    if len(answers) > 1:
        raise DeviceError(f"has {len(answers)} devices that answer", subject=bus.name, action=ALONE)
