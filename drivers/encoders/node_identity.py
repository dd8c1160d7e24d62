"""Who answers: every leg's node must be there, alone, and the device the cell file describes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode
from drivers.encoders.errors import MissingNodeError, WrongDeviceError, subject_of
from drivers.encoders.object_dictionary import (
    DEVICE_TYPE,
    ENCODER_PROFILE,
    MEASURING_STEP,
    MEASURING_STEP_SETTING,
    PRODUCT,
    REVISION,
    SERIAL_NUMBER,
    VENDOR,
    DeviceType,
)
from drivers.interfaces import DeviceIdentity
from hexacell.cell.devices import EncoderSettings

SECOND_RESPONSE_S = 0.03
"""How long a second device may take to answer the same request."""


def detect_nodes(nodes: Sequence[EncoderNode], bus: EncoderBus, timeout_s: float) -> None:
    """Ask all nodes at once whether they are there.

    Raises:
        MissingNodeError: Some do not answer within ``timeout_s``.
        DuplicatedNodeError: More than one device answers under one node id.
    """
    for node in nodes:
        node.sdo.probe()
    bus.wait_for(lambda: all(node.sdo.has_responded for node in nodes), timeout_s)
    bus.listen(SECOND_RESPONSE_S)
    for node in nodes:
        node.check_alone()
    missing = [node for node in nodes if not node.sdo.has_responded]
    if missing:
        raise _missing(missing, _strangers(nodes, bus))


def read_device_type(node: EncoderNode) -> DeviceType:
    """The kind of encoder that answers.

    Raises:
        WrongDeviceError: It is no absolute linear encoder.
    """
    value = node.read(DEVICE_TYPE)
    try:
        return DeviceType(value)
    except ValueError as error:
        raise WrongDeviceError(
            f"is no absolute linear encoder: its device type is {_device_type_in_words(value)}",
            node.leg,
            action="Check `nodes` under [encoders] in the cell file against the devices' node ids",
        ) from error


def check_measuring_step(node: EncoderNode, step_nm: float) -> None:
    """Compare the length of one count with the cell file's.

    Raises:
        WrongDeviceError: It differs, or the device does not tell.
    """
    found = node.read_optional(MEASURING_STEP_SETTING)
    if found is None:
        found = node.read(MEASURING_STEP)
    if not math.isclose(found, step_nm, rel_tol=1e-9):
        raise WrongDeviceError(
            f"counts in steps of {found} nm, the cell file says {step_nm:g} nm",
            node.leg,
            action="Correct `measuring_step_nm` under [encoders], or set the device with its maker's tool",
        )


def read_identity(node: EncoderNode, kind: DeviceType) -> DeviceIdentity:
    """The device's own identity (1018h); parts that it does not have are left out."""
    words = [f"CiA {ENCODER_PROFILE} {kind.description}"]
    for name, entry in (("vendor", VENDOR), ("product", PRODUCT), ("revision", REVISION)):
        value = node.read_optional(entry)
        words += [] if value is None else [f"{name} 0x{value:08X}"]
    serial_number = node.read_optional(SERIAL_NUMBER)
    return DeviceIdentity(
        name=subject_of([node.leg]),
        protocol="cia406",
        description=", ".join(words),
        serial_number="" if serial_number is None else str(serial_number),
    )


def check_serial_number(node: EncoderNode, identity: DeviceIdentity, settings: EncoderSettings) -> None:
    """Compare the serial number with the cell file's, if that states any.

    Raises:
        WrongDeviceError: Another device answers.
    """
    if settings.serial_numbers is None:
        return
    expected = str(settings.serial_numbers[node.leg.number - 1])
    if identity.serial_number != expected:
        raise WrongDeviceError(
            f"has serial number {identity.serial_number or '(none)'}, the cell file says {expected}",
            node.leg,
            action="If it was exchanged on purpose, correct `serial_numbers` under [encoders] and "
            "calibrate; if not, check which cable goes to which leg",
        )


def _missing(missing: Sequence[EncoderNode], strangers: Sequence[int]) -> MissingNodeError:
    found = ", ".join(str(node) for node in strangers)
    hint = f"; node {found} is on the bus but belongs to no leg" if strangers else ""
    return MissingNodeError(
        f"nobody answers{hint}",
        *(node.leg for node in missing),
        action="Check supply, cable, bit rate and node id",
    )


def _strangers(nodes: Sequence[EncoderNode], bus: EncoderBus) -> list[int]:
    """Nodes that answer although no leg has them: often a factory-set node id."""
    bus.network.scanner.search()
    bus.listen(SECOND_RESPONSE_S)
    return sorted(set(bus.network.scanner.nodes) - {node.leg.node for node in nodes})


def _device_type_in_words(value: int) -> str:
    profile, kind = value & 0xFFFF, value >> 16
    if profile == ENCODER_PROFILE:
        return f"0x{value:08X} (an encoder, but of class {kind}; linear ones are 8 and 10)"
    return f"0x{value:08X} (profile {profile}; encoders are {ENCODER_PROFILE})"
