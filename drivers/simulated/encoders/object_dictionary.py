"""The object dictionary of a simulated encoder, built from a table, and what differs between vendors."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from canopen.objectdictionary import ObjectDictionary, ODRecord, ODVariable
from canopen.objectdictionary.datatypes import INTEGER16, INTEGER32, UNSIGNED8, UNSIGNED16, UNSIGNED32


@dataclass(frozen=True, slots=True)
class TpdoDefaults:
    """A transmit PDO after power-on; ``mapping`` holds (index, subindex, bits)."""

    mapping: tuple[tuple[int, int, int], ...]
    transmission_type: int
    event_timer_ms: int = 0


MULTI_TURN = 0x0002_0196


@dataclass(frozen=True, slots=True)
class DeviceData:
    """Serial number and settings of one device; ``step`` is nm a count, or counts a turn."""

    node: int
    serial_number: int
    step: int
    signed: bool


POSITION = 0x6004
POSITION_OF_MAGNET = 0x6020
ERROR_REGISTER = 0x1001
SYNC_COUNTER = 0x1019
OPERATING_PARAMETERS = 0x6000
MEASURING_STEP = 0x6501
ALARMS = 0x6503
WARNINGS = 0x6505
OFFSET = 0x6509
TPDO_OFF = 1 << 31
MAPPING_SLOTS = 8


Row = tuple[int, int, str, int, int, str]
"""Index, subindex, name, data type, default value and access of an object."""


@dataclass(frozen=True)
class Vendor:
    """The encoders of one vendor."""

    device_type: int
    tpdos: tuple[TpdoDefaults, ...]

    def objects(self, data: DeviceData) -> Iterator[Row]:
        """The objects of a device: of communication, of the profile, and the TPDOs."""
        position, step = INTEGER32 if data.signed else UNSIGNED32, data.step
        yield (0x1000, 0, "device type", UNSIGNED32, self.device_type, "ro")
        yield (ERROR_REGISTER, 0, "error register", UNSIGNED8, 0, "ro")
        yield (0x1017, 0, "producer heartbeat time", UNSIGNED16, 0, "rw")
        yield (SYNC_COUNTER, 0, "overflow of the counter in SYNC", UNSIGNED8, 0, "rw")
        yield (0x1018, 0, "number of identity entries", UNSIGNED8, 4, "ro")
        yield (0x1018, 1, "vendor", UNSIGNED32, 0x0000_0406, "ro")
        yield (0x1018, 2, "product code", UNSIGNED32, self.device_type >> 16, "ro")
        yield (0x1018, 3, "revision", UNSIGNED32, 0x0001_0000, "ro")
        yield (0x1018, 4, "serial number in identity", UNSIGNED32, data.serial_number, "ro")
        yield (0x650B, 0, "serial number", UNSIGNED32, data.serial_number, "ro")
        yield (OPERATING_PARAMETERS, 0, "operating parameters", UNSIGNED16, 0, "rw")
        yield (POSITION, 0, "position", position, 0, "ro")
        if self.device_type == MULTI_TURN:
            yield (0x6001, 0, "measuring units per revolution", UNSIGNED32, step, "ro")
        else:
            yield (0x6005, 0, "number of step settings", UNSIGNED8, 2, "ro")
            yield (0x6005, 1, "position step", UNSIGNED32, step, "ro")
            yield (0x6005, 2, "speed step", UNSIGNED32, 100, "ro")
        yield (0x6030, 0, "number of speeds", UNSIGNED8, 1, "ro")
        yield (0x6030, 1, "speed", INTEGER16, 0, "ro")
        yield (MEASURING_STEP, 0, "measuring step", UNSIGNED32, step, "ro")
        yield (ALARMS, 0, "alarms", UNSIGNED16, 0, "ro")
        yield (0x6504, 0, "supported alarms", UNSIGNED16, 1, "ro")
        yield (WARNINGS, 0, "warnings", UNSIGNED16, 0, "ro")
        yield (OFFSET, 0, "offset", INTEGER32, 0, "ro")
        for number, tpdo in enumerate(self.tpdos, 1):
            yield from _tpdo(number, tpdo, data.node)


def _tpdo(number: int, tpdo: TpdoDefaults, node: int) -> Iterator[Row]:
    parameter, mapping = 0x1800 + number - 1, 0x1A00 + number - 1
    yield (parameter, 0, f"entries of TPDO {number}", UNSIGNED8, 5, "ro")
    yield (parameter, 1, "COB-ID", UNSIGNED32, 0x80 + 0x100 * number + node, "rw")
    yield (parameter, 2, "transmission type", UNSIGNED8, tpdo.transmission_type, "rw")
    yield (parameter, 3, "inhibit time", UNSIGNED16, 0, "rw")
    yield (parameter, 5, "event timer", UNSIGNED16, tpdo.event_timer_ms, "rw")
    yield (mapping, 0, f"mapped entries of TPDO {number}", UNSIGNED8, len(tpdo.mapping), "rw")
    slots = [index << 16 | subindex << 8 | bits for index, subindex, bits in tpdo.mapping]
    for slot, value in enumerate(slots + [0] * (MAPPING_SLOTS - len(slots)), 1):
        yield (mapping, slot, f"slot {slot}", UNSIGNED32, value, "rw")


_POSITION = (0x6004, 0, 32)
_SPEED = (0x6030, 1, 16)

EVENTS_AND_SYNC = Vendor(
    device_type=0x0008_0196,
    tpdos=(
        TpdoDefaults((_POSITION, _SPEED), transmission_type=254, event_timer_ms=10),
        TpdoDefaults((_POSITION, _SPEED), transmission_type=1),
    ),
)
"""TPDO1 on its event timer, TPDO2 with every SYNC."""

ROTARY = replace(EVENTS_AND_SYNC, device_type=MULTI_TURN)
"""TPDO1 on its event timer, TPDO2 with every SYNC, of an encoder of angles."""


def build(vendor: Vendor, data: DeviceData) -> ObjectDictionary:
    """The object dictionary of a device after power-on."""
    dictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
    for index, subindex, name, kind, value, access in vendor.objects(data):
        variable = ODVariable(name, index, subindex)
        variable.data_type, variable.default, variable.access_type = kind, value, access
        if subindex == 0 and index not in _RECORDS:
            dictionary.add_object(variable)
            continue
        if index not in dictionary:
            dictionary.add_object(ODRecord(f"record {index:04X}h", index))
        record = dictionary[index]
        assert isinstance(record, ODRecord)  # noqa: S101 - for the type checker
        record.add_member(variable)
    return dictionary


_RECORDS = {0x1018, 0x6005, 0x6020, 0x6030, *range(0x1800, 0x1804), *range(0x1A00, 0x1A04)}
