"""An encoder against its maker's electronic data sheet (an EDS file, CiA 306).

What the file says of a device is what its maker delivers. A node of another type, vendor or product is not
the device that the cell was set up with; settings that differ from the file's defaults were changed since,
perhaps on purpose.
"""

from __future__ import annotations

from configparser import Error as SyntaxFault
from configparser import RawConfigParser
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.objectdictionary.eds import import_eds

from drivers.encoders import object_dictionary as od
from drivers.encoders.canopen_node import EncoderNode
from drivers.encoders.object_dictionary import ObjectEntry
from hexacell.errors import DeviceError, FileError

WHAT_IT_IS = {"device type": od.DEVICE_TYPE, "vendor": od.VENDOR, "product": od.PRODUCT}
ABOUT = "DeviceInfo"
HOW_IT_IS_SET = {
    "operating parameters": od.OPERATING_PARAMETERS,
    "preset": od.PRESET,
    "measuring step": od.MEASURING_STEP_SETTING,
    "counts a turn": od.UNITS_PER_TURN,
}


@dataclass(frozen=True, slots=True)
class DataSheet:
    """The values of one file.

    Attributes:
        path: of the file.
        values: by entry, as unsigned integers.
    """

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
                raise DeviceError(
                    f"is not the device of {self.path.name}: its {name} is {has}, "
                    f"the file says 0x{stated:X}",
                    subject=node.leg.subject,
                    action="Name the EDS file of this device under [encoders], or check what was mounted",
                )
        differences = []
        for name, entry in HOW_IT_IS_SET.items():
            found, stated = node.read_optional(entry), self.values.get(entry)
            if None not in (found, stated) and found != stated:
                differences.append(f"{name} {found}, where {self.path.name} has {stated}")
        return ", ".join(differences)


def read_data_sheet(path: Path) -> DataSheet:
    """The values of an EDS file that are compared.

    Raises:
        FileError: it cannot be read, or is no EDS file.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")  # names may be in any encoding
        parser = RawConfigParser(inline_comment_prefixes=(";",))
        parser.read_string(text)
        if not parser.has_section(ABOUT):  # canopen would only warn
            raise _no_data_sheet(path, f"it has no section [{ABOUT}]")
        dictionary: ObjectDictionary = import_eds(StringIO(text), None)  # type: ignore[no-untyped-call]
    except OSError as error:
        raise FileError(
            f"cannot be read: {error.strerror}", subject=path, action="Correct eds under [encoders]"
        ) from error
    except (SyntaxFault, ValueError, KeyError, TypeError, IndexError) as error:
        raise _no_data_sheet(path, str(error) or type(error).__name__) from error
    entries = (*WHAT_IT_IS.values(), *HOW_IT_IS_SET.values())
    values = {entry: value for entry in entries if (value := _default(dictionary, entry)) is not None}
    if od.DEVICE_TYPE not in values:
        raise _no_data_sheet(path, f"it has no {od.DEVICE_TYPE}")
    return DataSheet(path, values)


def _no_data_sheet(path: Path, reason: str) -> FileError:
    return FileError(
        f"is no EDS file of an encoder: {' '.join(reason.split())}",
        subject=path,
        action="Get it from the encoder's maker, or remove eds from [encoders]",
    )


def _default(dictionary: ObjectDictionary, entry: ObjectEntry) -> int | None:
    """The default of an entry as a node sends it, unsigned; what the file is about has its own section."""
    found = dictionary.get(entry.index)
    if isinstance(found, ODVariable):
        found = found if entry.subindex == 0 else None
    elif found is not None:
        found = found.get(entry.subindex)
    value = None if found is None else found.default
    if value is None and entry in (od.VENDOR, od.PRODUCT):
        about = dictionary.device_information
        value = about.vendor_number if entry is od.VENDOR else about.product_number
    return int(value) % (1 << 8 * entry.size) if isinstance(value, int) else None
