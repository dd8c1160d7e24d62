"""The object dictionary entries used by the driver (CiA 301 and CiA 406)."""

from dataclasses import dataclass
from enum import IntEnum

from hexacell.kinematics.parameters import JointUnit


@dataclass(frozen=True, slots=True)
class ObjectEntry:
    """One entry; ``size`` is the length of its value in a write, bytes."""

    index: int
    subindex: int
    size: int

    def __str__(self) -> str:
        return f"object {self.index:04X}h:{self.subindex}"


class NmtCommand(IntEnum):
    """NMT commands (CiA 301)."""

    START = 0x01
    ENTER_PRE_OPERATIONAL = 0x80


class DeviceType(IntEnum):
    """The supported values of 1000h: profile 406 and the encoder class."""

    SINGLE_TURN = 0x0001_0196
    MULTI_TURN = 0x0002_0196
    ABSOLUTE_LINEAR = 0x0008_0196
    SEVERAL_MAGNETS = 0x000A_0196

    @property
    def unit(self) -> JointUnit:
        """The unit of the joint variables that it measures."""
        is_rotary = self in {DeviceType.SINGLE_TURN, DeviceType.MULTI_TURN}
        return JointUnit.DEG if is_rotary else JointUnit.MM

    @property
    def description(self) -> str:
        """The name of this type."""
        return {
            DeviceType.SINGLE_TURN: "absolute rotary encoder",
            DeviceType.MULTI_TURN: "absolute rotary encoder of several turns",
            DeviceType.ABSOLUTE_LINEAR: "absolute linear encoder",
            DeviceType.SEVERAL_MAGNETS: "absolute linear encoder for several magnets",
        }[self]

    @property
    def position(self) -> ObjectEntry:
        """The entry with the position, of the first magnet if there are several."""
        return POSITION_OF_MAGNET_1 if self is DeviceType.SEVERAL_MAGNETS else POSITION


ENCODER_PROFILE, NMT = 406, 0x000

DEVICE_TYPE = ObjectEntry(0x1000, 0, 4)
ERROR_REGISTER = ObjectEntry(0x1001, 0, 1)
SYNC_ID = ObjectEntry(0x1005, 0, 4)
"""Identifier of the SYNC that it waits for; bit 30: it sends SYNC itself."""
SYNC_COUNTER = ObjectEntry(0x1019, 0, 1)
"""At what a counter in the SYNC overflows; 0: the SYNC has none (CiA 301)."""
PRODUCER_HEARTBEAT = ObjectEntry(0x1017, 0, 2)
VENDOR = ObjectEntry(0x1018, 1, 4)
PRODUCT = ObjectEntry(0x1018, 2, 4)
REVISION = ObjectEntry(0x1018, 3, 4)
SERIAL_NUMBER = ObjectEntry(0x1018, 4, 4)

OPERATING_PARAMETERS = ObjectEntry(0x6000, 0, 2)
PRESET = ObjectEntry(0x6003, 0, 4)
POSITION = ObjectEntry(0x6004, 0, 4)
POSITION_OF_MAGNET_1 = ObjectEntry(0x6020, 1, 4)
UNITS_PER_TURN = ObjectEntry(0x6001, 0, 4)
MEASURING_STEP_SETTING = ObjectEntry(0x6005, 1, 4)
MEASURING_STEP = ObjectEntry(0x6501, 0, 4)
RESOLUTION = ObjectEntry(0x6501, 0, 4)
"""Physical resolution of a rotary encoder; object 6001h may divide it into other counts a turn."""
ALARMS = ObjectEntry(0x6503, 0, 2)
WARNINGS = ObjectEntry(0x6505, 0, 2)
OFFSET = ObjectEntry(0x6509, 0, 4)
"""What the device subtracts, computed from its preset."""

TPDO_COUNT = 4
"""TPDOs whose COB-IDs are predefined: 180h, 280h, 380h and 480h plus the node id (CiA 301)."""


COB_ID, TRANSMISSION_TYPE, EVENT_TIMER = 1, 2, 5
"""Communication parameters of a TPDO: the COB-ID has bit 31 set while it is off; the transmission type is
1 to 240 with every n-th SYNC, 254 and 255 on events; the event timer is in ms, 0 is off."""
TPDO_PARAMETER_BYTES = {COB_ID: 4, TRANSMISSION_TYPE: 1, EVENT_TIMER: 2}


def tpdo_parameter(number: int, parameter: int) -> ObjectEntry:
    """A communication parameter of TPDO ``number`` (from 1)."""
    return ObjectEntry(0x1800 + number - 1, parameter, TPDO_PARAMETER_BYTES[parameter])


def tpdo_mapping(number: int, slot: int) -> ObjectEntry:
    """Its mapping in ``slot`` (from 1); slot 0 is the number of mapped entries."""
    return ObjectEntry(0x1A00 + number - 1, slot, 4 if slot else 1)
