"""Identification of the nodes: each must respond, be the only one with its id, and match the cell file.

Every function raises a ``DeviceError`` that names the leg where that is not so. An electronic data sheet
(an EDS file, CiA 306) says what the maker delivers. A node of another type, vendor or product is not the
device that the cell was set up with; settings that differ from the file's defaults were changed since,
perhaps on purpose.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from drivers.encoders import object_dictionary as od
from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode, subject_of
from drivers.encoders.object_dictionary import DeviceType, ObjectEntry
from drivers.errors import BusError
from drivers.interfaces import DeviceIdentity
from hexacell.cell.devices import EncoderSettings, LinearEncoderSettings, RotaryEncoderSettings
from hexacell.errors import FileError
from hexacell.kinematics.parameters import JointUnit
from hexacell.storage.atomic_files import read_bytes

STEP_OBJECTS = {"6005h": od.MEASURING_STEP_SETTING, "6501h": od.MEASURING_STEP}
"""Objects that a device may have its measuring step in."""

REVERSED = 1 << 3
"""Bit of the operating parameters: counts grow in the other direction (CiA 406)."""
_HALF = 1 << 31

SECOND_RESPONSE_S = 0.03
"""How long a second device may take to respond to the same request."""


def detect_nodes(nodes: Sequence[EncoderNode], bus: EncoderBus, timeout_s: float) -> None:
    """Make sure that one device responds under each node id within ``timeout_s``, all probed at once."""
    for node in nodes:
        node.sdo.probe()
    bus.wait_for(lambda: all(node.sdo.has_responded for node in nodes), timeout_s)
    bus.listen(SECOND_RESPONSE_S)
    for node in nodes:
        node.check_alone()
    missing = [node for node in nodes if not node.sdo.has_responded]
    if missing:
        # Nodes that respond but belong to no leg often have a node id from the factory.
        bus.network.scanner.search()
        bus.listen(SECOND_RESPONSE_S)
        unexpected = sorted(set(bus.network.scanner.nodes) - {node.leg.node for node in nodes})
        found = ", ".join(map(str, unexpected))
        is_alone = len(missing) == len(nodes) and not bus.hears
        hint = "" if len(missing) < len(nodes) or is_alone else "; others send"
        hint = f"; node {found} is on the bus but belongs to no leg" if unexpected else hint
        odd = [node for node in missing if node.sdo.latest or node.leg.node in bus.network.scanner.nodes]
        where = "the CAN adapter, supply, cable, termination, bit rate" if is_alone else "supply, cable"
        action = f"Check {where} and node id"
        if len(odd) == len(missing):
            hint += "; it sends, but no answer of eight bytes to SDO requests"
            action = "Try again, it may just have started; else set it with its vendor's tool"
        told = f"no device responds{hint}{bus.reported}"
        raise BusError(told, subject=subject_of([node.leg for node in missing]), action=action)


def read_device_type(node: EncoderNode, unit: JointUnit = JointUnit.MM) -> DeviceType:
    """The device type of a node, which must be an absolute encoder of joint variables in a unit."""
    value = node.read(od.DEVICE_TYPE)
    if value not in {kind.value for kind in DeviceType if kind.unit is unit}:
        wanted = "linear" if unit is JointUnit.MM else "rotary"
        profile, kind = value & 0xFFFF, value >> 16
        what = f"profile {profile}; encoders are {od.ENCODER_PROFILE}"
        if profile == od.ENCODER_PROFILE:
            classes = " and ".join(str(one >> 16) for one in DeviceType if one.unit is unit)
            what = f"an encoder, but of class {kind}; {wanted} ones are {classes}"
        raise node.leg.error(
            f"is no absolute {wanted} encoder: its device type is 0x{value:08X} ({what})",
            "Check `nodes` under [encoders] in the cell file against the devices' node ids",
        )
    return DeviceType(value)


def check_step(node: EncoderNode, settings: EncoderSettings) -> None:
    """Compare what a count is with the cell file."""
    if isinstance(settings, LinearEncoderSettings):
        found = _measuring_step(node, settings.step_object)
        is_right = math.isclose(found, settings.measuring_step_nm, rel_tol=1e-9)
        has, stated = f"a measuring step of {found} nm", f"{settings.measuring_step_nm:g} nm"
        key = "measuring_step_nm"
    elif isinstance(settings, RotaryEncoderSettings):
        counts = node.read_optional(od.UNITS_PER_TURN)
        found = node.read(od.RESOLUTION) if counts is None else counts
        is_right = found == settings.counts_per_turn
        has, stated, key = f"{found} counts a turn", str(settings.counts_per_turn), "counts_per_turn"
    else:
        return
    if not is_right:
        raise node.leg.error(
            f"has {has}, the cell file says {stated}",
            f"Correct `{key}` under [encoders], or set the device with its vendor's tool",
        )


def _measuring_step(node: EncoderNode, stated: str) -> int:
    """The measuring step, nm, from the object that the cell file names, or the one that it has."""
    if stated in STEP_OBJECTS:
        return node.read(STEP_OBJECTS[stated])
    setting, step = node.read_optional(od.MEASURING_STEP_SETTING), node.read_optional(od.MEASURING_STEP)
    if setting is None:
        return node.read(od.MEASURING_STEP)
    if step is not None and step != setting:
        raise node.leg.error(
            f"has two measuring steps: {setting} nm in {od.MEASURING_STEP_SETTING}, {step} nm in "
            f"{od.MEASURING_STEP}",
            "Move the joint by a known length to see which holds, and name it: "
            '`step_object = "6005h"` or "6501h" under [encoders]',
        )
    return setting


def read_identity(node: EncoderNode, kind: DeviceType) -> DeviceIdentity:
    """The identity object of the device (1018h), without the entries that it does not have."""
    words = [f"CiA {od.ENCODER_PROFILE} {kind.description}"]
    for name, entry in (("vendor", od.VENDOR), ("product", od.PRODUCT), ("revision", od.REVISION)):
        value = node.read_optional(entry)
        words += [] if value is None else [f"{name} 0x{value:08X}"]
    serial_number = node.read_optional(od.SERIAL_NUMBER)
    settings, warnings = read_settings(node), node.read_optional(od.WARNINGS)
    return DeviceIdentity(
        name=node.leg.subject,
        protocol="cia406",
        description=", ".join(words),
        serial_number="" if serial_number is None else str(serial_number),
        settings=settings,
        remark=f"it reports a warning: {od.WARNINGS} is {warnings:#06x}" if warnings else "",
    )


def read_settings(node: EncoderNode) -> str:
    """Direction, preset and offset in words, as far as the device has them.

    A preset, a reversed direction or an offset that somebody set changes a joint variable without moving
    the joint. They are part of the identity, which every run records and compares.
    """
    words = []
    if (parameters := node.read_optional(od.OPERATING_PARAMETERS)) is not None:
        direction = "reversed, " if parameters & REVERSED else ""
        words.append(f"operating parameters {direction}{parameters:#06x}")
    for name, entry in (("preset", od.PRESET), ("offset", od.OFFSET)):
        if (value := node.read_optional(entry)) is not None:
            words.append(f"{name} {value if value < _HALF else value - 2 * _HALF}")
    return ", ".join(words)


def check_serial_number(node: EncoderNode, identity: DeviceIdentity, settings: EncoderSettings) -> None:
    """Compare the serial number with the cell file, if that has one."""
    if settings.serial_numbers is None:
        return
    expected = str(settings.serial_numbers[node.leg.number - 1])
    if identity.serial_number != expected:
        raise node.leg.error(
            f"has serial number {identity.serial_number or '(none)'}, the cell file says {expected}",
            "If it was exchanged on purpose, correct `serial_numbers` under [encoders] and "
            "calibrate; if not, check which cable goes to which leg",
        )


WHAT_IT_IS = {"device type": od.DEVICE_TYPE, "vendor": od.VENDOR, "product": od.PRODUCT}
ABOUT, DEFAULT = "deviceinfo", "defaultvalue"
ABOUT_KEYS = {od.VENDOR: "vendornumber", od.PRODUCT: "productnumber"}
ONE_DIGIT = re.compile(r"-?0*[0-9]")
HOW_IT_IS_SET = {
    "operating parameters": od.OPERATING_PARAMETERS,
    "preset": od.PRESET,
    "measuring step": od.MEASURING_STEP_SETTING,
    "counts a turn": od.UNITS_PER_TURN,
}


@dataclass(frozen=True, slots=True)
class DataSheet:
    """The values of one file by their entries, as unsigned integers."""

    path: Path
    values: dict[ObjectEntry, int]

    def check(self, node: EncoderNode) -> str:
        """Compare a node with the file; the settings that differ from its defaults, in words.

        Raises:
            DeviceError: it is another device than the file describes.
        """
        for name, entry in WHAT_IT_IS.items():
            found, stated = node.read_optional(entry), self.values.get(entry)
            if stated is not None and found != stated:
                has = "none" if found is None else f"0x{found:X}"
                raise node.leg.error(
                    f"is not the device of {self.path.name}: its {name} is {has}, "
                    f"the file says 0x{stated:X}",
                    "Name the EDS file of this device under [encoders], or check what was mounted",
                )
        differences = []
        for name, entry in HOW_IT_IS_SET.items():
            found, stated = node.read_optional(entry), self.values.get(entry)
            if None not in (found, stated) and found != stated:
                differences.append(f"{name} {found}, where {self.path.name} has {stated}")
        return ", ".join(differences)


def read_data_sheet(path: Path) -> DataSheet:
    """The values of an EDS file that are compared; whatever else is in it is not looked at.

    Raises:
        FileError: it cannot be read, says nothing of what a device is, or a value of these is no number.
    """
    text = read_bytes(path).decode("utf-8-sig", errors="replace")  # names may be in any encoding
    lines, entries = _lines(text), (*WHAT_IT_IS.values(), *HOW_IT_IS_SET.values())
    values = {entry: value for entry in entries if (value := _default(lines, entry, path)) is not None}
    if not values.keys() & WHAT_IT_IS.values():
        raise FileError(
            f"is no EDS file of an encoder: it has none of {', '.join(WHAT_IT_IS)}",
            subject=path,
            action="Get it from the encoder's maker, or remove eds from [encoders]",
        )
    return DataSheet(path, values)


_Lines = dict[tuple[str, str], tuple[str, int]]


def _lines(text: str) -> _Lines:
    """By section and key, in small letters: the value and its line; by an empty key what has no ``=``."""
    section, found = "", _Lines()
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition(";")[0].strip()
        key, equals, value = (part.strip() for part in words.partition("="))
        if words.startswith("[") and words.endswith("]"):
            section = words[1:-1].strip().lower()
        elif value or (words and not equals):
            found[section, key.lower() if equals else ""] = value or words, number
    return found


def _default(lines: _Lines, entry: ObjectEntry, path: Path) -> int | None:
    """The default of an entry as a node sends it, unsigned; what the file is about has its own section."""
    whole, part = f"{entry.index:x}", f"{entry.index:x}sub{entry.subindex:x}"
    is_whole = entry.subindex == 0 or (whole, "compactsubobj") in lines
    places = [(section, key) for section in (part, whole)[: 1 + is_whole] for key in (DEFAULT, "")]
    places += [(ABOUT, ABOUT_KEYS[entry])] if entry in ABOUT_KEYS else []
    place = next((one for one in places if one in lines), None)
    if place is None:
        return None
    text, line = lines[place]
    if (number := _number(text)) is None:
        problem = f"has {text!r} in section [{place[0]}], where a number is needed"
        action = "Write DefaultValue= (or the key that is there) and the number, 0x1A if in hexadecimal"
        raise FileError(problem, subject=path, line=line, action=action)
    return number % (1 << 8 * entry.size)


def _number(text: str) -> int | None:
    """A number in decimal or hexadecimal; None for another text, and for what may be octal or decimal."""
    try:
        return int(text, 0)
    except ValueError:
        return int(text) if ONE_DIGIT.fullmatch(text) else None
