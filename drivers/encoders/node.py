"""One encoder as a CANopen node: its dictionary entries, read and written, and its state."""

from __future__ import annotations

from enum import IntEnum

from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.encoders.bus import EncoderBus
from drivers.encoders.errors import (
    ConfigurationError,
    DuplicatedNodeError,
    SilentNodeError,
    WrongDeviceError,
)
from drivers.encoders.legs import Leg
from drivers.encoders.objects import Entry
from drivers.encoders.sdo import CountingSdoClient

_NMT = 0x000


class NmtCommand(IntEnum):
    """What the network manager tells a node (CiA 301)."""

    START = 0x01
    ENTER_PRE_OPERATIONAL = 0x80


class EncoderNode:
    """The node of one leg's encoder. Integers in the dictionary are taken as unsigned."""

    def __init__(self, leg: Leg, bus: EncoderBus, timeout_s: float) -> None:
        self.leg = leg
        self.sdo = CountingSdoClient(bus, leg.node, timeout_s)
        self._bus = bus

    def command(self, command: NmtCommand) -> None:
        """Change the node's state; nodes do not acknowledge that.

        Raises:
            BusError: The bus does not take the frame.
        """
        self._bus.network.send_message(_NMT, bytes((command, self.leg.node)))

    def read(self, entry: Entry) -> int:
        """The value of an entry that must be there.

        Raises:
            NodeError: It is not, or nobody answers.
        """
        value = self.read_optional(entry)
        if value is None:
            raise WrongDeviceError(
                f"has no {entry}", self.leg, action="Check that it is a CANopen encoder (CiA 406)"
            )
        return value

    def read_optional(self, entry: Entry) -> int | None:
        """The value of an entry; none if the device says that it has no such thing.

        Raises:
            NodeError: Nobody answers, or two do.
        """
        try:
            return int.from_bytes(self.sdo.upload(entry.index, entry.subindex), "little")
        except SdoAbortedError:
            return None
        except SdoCommunicationError as error:
            raise self._no_sense(entry, error) from error

    def write(self, entry: Entry, value: int) -> None:
        """Write an entry.

        Raises:
            NodeError: The device refuses, nobody answers, or two do.
        """
        try:
            self.sdo.download(entry.index, entry.subindex, value.to_bytes(entry.size, "little"))
        except SdoAbortedError as error:
            raise ConfigurationError(
                f"does not let {entry} be set to {value:#x}: {error}",
                self.leg,
                action="Set it with the maker's tool, or use another device",
            ) from error
        except SdoCommunicationError as error:
            raise self._no_sense(entry, error) from error

    def check_alone(self) -> None:
        """Raise if a second device answered under this node id.

        Raises:
            DuplicatedNodeError: One did.
        """
        if self.sdo.surplus:
            raise duplicated("answered one request twice", self.leg)

    def _no_sense(self, entry: Entry, error: Exception) -> DuplicatedNodeError | SilentNodeError:
        if self.sdo.surplus:
            return duplicated("answered one request twice", self.leg)
        return SilentNodeError(
            f"does not answer for {entry}: {error}",
            self.leg,
            action="Check its supply and cable, then open the encoders again",
        )


def duplicated(what: str, leg: Leg) -> DuplicatedNodeError:
    """The error for a node id that two devices share."""
    return DuplicatedNodeError(
        f"{what}: two devices share node id {leg.node}, or another program uses this bus",
        leg,
        action="Unplug one of them, or give it another node id, then open the encoders again",
    )
