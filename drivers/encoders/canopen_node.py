"""One encoder as a CANopen node: NMT commands, and its object dictionary over SDO.

The SDO client can be interrupted, and detects a second device under the same node id.
"""

from __future__ import annotations

from enum import IntEnum

from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.errors import (
    ConfigurationError,
    DuplicatedNodeError,
    Leg,
    SilentNodeError,
    WrongDeviceError,
)
from drivers.encoders.object_dictionary import ObjectEntry

_NMT = 0x000


class NmtCommand(IntEnum):
    """NMT commands (CiA 301)."""

    START = 0x01
    ENTER_PRE_OPERATIONAL = 0x80


class EncoderNode:
    """The CANopen node of one leg's encoder. Integers are read and written as unsigned."""

    def __init__(self, leg: Leg, bus: EncoderBus, timeout_s: float) -> None:
        self.leg = leg
        self.sdo = CountingSdoClient(bus, leg.node, timeout_s)
        self._bus = bus

    def command(self, command: NmtCommand) -> None:
        """Send an NMT command; nodes do not acknowledge it.

        Raises:
            BusError: The bus does not accept the frame.
        """
        self._bus.network.send_message(_NMT, bytes((command, self.leg.node)))

    def read(self, entry: ObjectEntry) -> int:
        """The value of a mandatory entry.

        Raises:
            NodeError: The entry does not exist, or the node does not respond.
        """
        value = self.read_optional(entry)
        if value is None:
            raise WrongDeviceError(
                f"has no {entry}", self.leg, action="Check that it is a CANopen encoder (CiA 406)"
            )
        return value

    def read_optional(self, entry: ObjectEntry) -> int | None:
        """The value of an entry; none if the device does not have it.

        Raises:
            NodeError: No response, or two.
        """
        try:
            return int.from_bytes(self.sdo.upload(entry.index, entry.subindex), "little")
        except SdoAbortedError:
            return None
        except SdoCommunicationError as error:
            raise self._communication_error(entry, error) from error

    def write(self, entry: ObjectEntry, value: int) -> None:
        """Write an entry.

        Raises:
            NodeError: The device refuses, or there is no response, or two.
        """
        try:
            self.sdo.download(entry.index, entry.subindex, value.to_bytes(entry.size, "little"))
        except SdoAbortedError as error:
            raise ConfigurationError(
                f"refuses to set {entry} to {value:#x}: {error}",
                self.leg,
                action="Set it with the vendor's tool, or use another device",
            ) from error
        except SdoCommunicationError as error:
            raise self._communication_error(entry, error) from error

    def check_alone(self) -> None:
        """Raise if a second device responded under this node id.

        Raises:
            DuplicatedNodeError: It did.
        """
        if self.sdo.has_surplus_response:
            raise duplicated_node("responded twice to one request", self.leg)

    def _communication_error(
        self, entry: ObjectEntry, error: Exception
    ) -> DuplicatedNodeError | SilentNodeError:
        if self.sdo.has_surplus_response:
            return duplicated_node("responded twice to one request", self.leg)
        return SilentNodeError(
            f"does not respond for {entry}: {error}",
            self.leg,
            action="Check its supply and cable, then open the encoders again",
        )


def duplicated_node(what: str, leg: Leg) -> DuplicatedNodeError:
    """The error for a node id that two devices share."""
    return DuplicatedNodeError(
        f"{what}: two devices share node id {leg.node}, or another program uses this bus",
        leg,
        action="Unplug one of them, or give it another node id, then open the encoders again",
    )


SDO_REQUEST = 0x600
SDO_RESPONSE = 0x580
_UPLOAD_DEVICE_TYPE = bytes((0x40, 0x00, 0x10, 0, 0, 0, 0, 0))


class CountingSdoClient(SdoClient):
    """canopen's SDO client with interruptible waits and a count of outstanding responses.

    Attributes:
        has_surplus_response: there were more responses than requests: two devices share the node id.
        has_responded: there was a response.
    """

    RESPONSE_TIMEOUT = 0.0  # read_response waits before canopen does

    def __init__(self, bus: EncoderBus, node: int, timeout_s: float) -> None:
        dictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
        super().__init__(SDO_REQUEST + node, SDO_RESPONSE + node, dictionary)  # type: ignore[no-untyped-call]
        self.network = bus.network
        self.has_surplus_response = False
        self.has_responded = False
        self._bus = bus
        self._timeout_s = timeout_s
        self._outstanding = 0
        bus.network.subscribe(self.tx_cobid, self.on_response)

    def probe(self) -> None:
        """Request the device type without waiting; a response sets ``has_responded``."""
        self._outstanding += 1
        self.send_request(_UPLOAD_DEVICE_TYPE)  # type: ignore[no-untyped-call]

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Handle a received response; a frame that is too short is ignored."""
        if len(data) != 8:
            return
        self.has_responded = True
        self._outstanding -= 1
        self.has_surplus_response = self.has_surplus_response or self._outstanding < 0
        super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]
        self._bus.condition.notify_all()

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send one request and return its response, after any outstanding earlier one.

        Raises:
            DeviceError: As :meth:`EncoderBus.check`.
            canopen.SdoError: No response, an abort, or an invalid response.
        """
        self._bus.wait_for(lambda: self._outstanding <= 0, self._timeout_s)
        with self._bus.condition:
            self._outstanding = 1
        response: bytes = super().request_response(sdo_request)  # type: ignore[no-untyped-call]
        return response

    def read_response(self) -> bytes:
        """Wait for the response.

        Raises:
            DeviceError: As :meth:`EncoderBus.check`.
            canopen.SdoError: No response, or an abort.
        """
        self._bus.wait_for(lambda: not self.responses.empty(), self._timeout_s)
        response: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return response
