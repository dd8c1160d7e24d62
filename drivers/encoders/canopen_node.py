"""One encoder as a CANopen node: NMT commands, and its object dictionary over SDO.

The SDO client can be interrupted, and detects a second device under the same node id.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.object_dictionary import NMT, NmtCommand, ObjectEntry
from drivers.errors import PAUSE_S, TIMES_ASKED, SilentNodeError, silent_encoder
from hexacell.errors import DeviceError

ABSENT = frozenset({0x0602_0000, 0x0609_0011})
"""The abort codes that mean that there is no such entry: no object, no subindex (CiA 301)."""


@dataclass(frozen=True, slots=True)
class Leg:
    """One leg's encoder; ``number`` counts from 1, ``node`` is the CANopen node id (1 to 127)."""

    number: int
    node: int

    def __str__(self) -> str:
        return f"leg {self.number} (node {self.node})"

    @property
    def subject(self) -> str:
        """The subject of messages about this encoder."""
        return subject_of([self])

    def error(self, problem: str, action: str) -> DeviceError:
        """The error for what this encoder does, without a reaction of its own."""
        return DeviceError(problem, subject=self.subject, action=action)


def subject_of(legs: Sequence[Leg]) -> str:
    """The subject of messages about one or more encoders."""
    noun = "encoder of" if len(legs) == 1 else "encoders of"
    return f"{noun} {', '.join(map(str, legs))}"


class EncoderNode:
    """The CANopen node of one leg's encoder. Integers are read and written as unsigned.

    A node that does not respond is a ``SilentNodeError``; two that respond, and a device that refuses to
    be read or a value, or has no such entry, are a ``DeviceError``.
    """

    def __init__(self, leg: Leg, bus: EncoderBus, timeout_s: float) -> None:
        self.leg = leg
        self.sdo = CountingSdoClient(bus, leg.node, timeout_s)
        self._bus = bus

    def command(self, command: NmtCommand) -> None:
        """Send an NMT command; nodes do not acknowledge it."""
        self._bus.network.send_message(NMT, bytes((command, self.leg.node)))

    def read(self, entry: ObjectEntry) -> int:
        """The value of a mandatory entry."""
        if (value := self.read_optional(entry)) is None:
            raise self.leg.error(f"has no {entry}", "Check that it is a CANopen encoder (CiA 406)")
        return value

    def read_optional(self, entry: ObjectEntry) -> int | None:
        """The value of an entry; None if the device says that it does not have it."""

        def upload() -> int:
            data = self.sdo.upload(entry.index, entry.subindex)
            # Four bytes without a size may have others behind the entry's own.
            is_unsized = self.sdo.latest[0] & _SIZE_BITS == _EXPEDITED
            return int.from_bytes(data[: entry.size] if is_unsized else data, "little")

        try:
            return self._asked(entry, upload)
        except SdoAbortedError as error:
            if error.code in ABSENT:
                return None
            raise self.leg.error(
                f"refuses {TIMES_ASKED} times to read {entry}: {error}",
                "Switch it off and on, then try again; if it stays so, look the code up in its manual",
            ) from error

    def write(self, entry: ObjectEntry, value: int) -> None:
        """Write an entry."""
        data = value.to_bytes(entry.size, "little")
        try:
            self._asked(entry, lambda: self.sdo.download(entry.index, entry.subindex, data))
        except SdoAbortedError as error:
            raise setting_refused(f"refuses to set {entry} to {value:#x}: {error}", self.leg) from error

    def _asked(self, entry: ObjectEntry, call: Callable[[], int | None]) -> int | None:
        """What a transfer gives, or ``SdoAbortedError``: that of the last time, unless it means absence."""
        left = TIMES_ASKED
        while True:
            try:
                return call()
            except SdoAbortedError as error:
                left -= 1
                if not left or error.code in ABSENT:
                    raise
            except SdoCommunicationError as error:
                raise self._communication_error(entry, error) from error
            self._bus.listen(PAUSE_S)

    def check_alone(self) -> None:
        """Raise if a second device responded under this node id."""
        if self.sdo.has_surplus_response:
            raise duplicated_node("responded twice to one request", self.leg)

    def _communication_error(self, entry: ObjectEntry, error: Exception) -> DeviceError:
        self.check_alone()
        if not self.sdo.latest:
            return silent_nodes(f"does not respond for {entry}: {error}", [self.leg])
        return self.leg.error(
            f"does not respond as it should for {entry}, but {self.sdo.latest.hex(' ')}: {error}",
            "End other programs that ask it, then try again, or use another device",
        )


def setting_refused(what: str, leg: Leg) -> DeviceError:
    """The error for a device that does not take a setting needed for one sample per SYNC."""
    return leg.error(what, "Set it with the vendor's tool, or use another device")


def duplicated_node(what: str, leg: Leg) -> DeviceError:
    """The error for a node id that two devices share."""
    return leg.error(
        f"{what}: two devices share node id {leg.node}, another program uses this bus, or it answers late",
        "Unplug one, give it another node id, or raise timeout_s, then try again",
    )


THE_NODE, THE_BUS = "Check its supply and cable", "Check the CAN adapter, supply and termination"


def silent_nodes(what: str, legs: Sequence[Leg], remedy: str = THE_NODE) -> SilentNodeError:
    """The error for encoders that do not answer; ``remedy`` as in ``silent_encoder``."""
    error = silent_encoder(what, subject_of(legs), remedy)
    error.legs = frozenset(leg.number for leg in legs)
    return error


RESTS = "Read why in its error register (object 1001h), or switch it off and on"


def explained(
    error: SilentNodeError, nodes: Sequence[EncoderNode], bus: EncoderBus, resting: Collection[Leg] = ()
) -> SilentNodeError:
    """The error with all that are silent now, and advice that fits to those that answer.

    ``resting`` are those whose heartbeat says that they were not started.

    Raises ``BusError`` if the bus itself has failed, which explains all.
    """
    health_check, bus.health_check = bus.health_check, lambda: None  # it would raise the same again
    try:
        for node in nodes:
            node.sdo.probe()
        bus.wait_for(lambda: all(node.sdo.has_responded for node in nodes), nodes[0].sdo.timeout_s)
    finally:
        bus.health_check = health_check
    named = [node.leg for node in nodes if node.leg.number in error.legs]
    silent = [node.leg for node in nodes if not node.sdo.has_responded]
    if len(silent) == len(nodes):
        return silent_nodes(f"{error.problem}; no encoder answers{bus.reported}", silent, THE_BUS)
    if set(named) & set(silent):
        return silent_nodes(f"{error.problem}; the others answer", silent)
    if set(named) <= set(resting):
        return silent_nodes(f"{error.problem}: by its heartbeat it did not start", named, RESTS)
    remedy = THE_BUS if len(named) == len(nodes) else "Check its supply for a dip, timeout_s, heartbeat_ms"
    return silent_nodes(f"{error.problem}, but SDO requests are answered", named, remedy)


SDO_REQUEST = 0x600
SDO_RESPONSE = 0x580
_SIZE_BITS, _EXPEDITED = 3, 2
"""Bits of the first byte of a response: its value is in it; without the other bit its size is not."""
_UPLOAD_DEVICE_TYPE = bytes((0x40, 0x00, 0x10, 0, 0, 0, 0, 0))


class CountingSdoClient(SdoClient):
    """canopen's SDO client with interruptible waits and a count of outstanding responses.

    Failures are those of :meth:`EncoderBus.check`, and a ``canopen.SdoError`` where there is no valid
    response or it is an abort.

    ``has_responded``: there was a response; ``has_surplus_response``: there were more than requests, so two
    devices share the node id; ``latest`` is what came since the latest request, of whatever length.
    """

    RESPONSE_TIMEOUT = 0.0  # read_response waits before canopen does

    def __init__(self, bus: EncoderBus, node: int, timeout_s: float) -> None:
        dictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
        super().__init__(SDO_REQUEST + node, SDO_RESPONSE + node, dictionary)  # type: ignore[no-untyped-call]
        self.network = bus.network
        self.has_surplus_response = False
        self.has_responded = False
        self._bus = bus
        self.timeout_s = timeout_s
        self._outstanding = 0
        self.latest = b""
        bus.network.subscribe(self.tx_cobid, self.on_response)

    def probe(self) -> None:
        """Request the device type without waiting; a response sets ``has_responded``."""
        self.has_responded, self.latest = False, b""
        self._outstanding += 1
        self.send_request(_UPLOAD_DEVICE_TYPE)  # type: ignore[no-untyped-call]

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Handle a received response; a frame that is too short is ignored."""
        self.latest = bytes(data)
        if len(data) != 8:
            return
        self.has_responded = True
        self._outstanding -= 1
        self.has_surplus_response = self.has_surplus_response or self._outstanding < 0
        super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]
        self._bus.condition.notify_all()

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send one request and return its response, after any outstanding earlier one."""
        self._bus.wait_for(lambda: self._outstanding <= 0, self.timeout_s)
        with self._bus.condition:
            self._outstanding, self.latest = 1, b""
        response: bytes = super().request_response(sdo_request)  # type: ignore[no-untyped-call]
        return response

    def read_response(self) -> bytes:
        """Wait for the response."""
        self._bus.wait_for(lambda: not self.responses.empty(), self.timeout_s)
        response: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return response
