"""Settings of encoders that differ from their maker's EDS file are told, and another device is refused."""

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from drivers.encoders.node_identity import read_data_sheet
from drivers.encoders.object_dictionary import DEVICE_TYPE, PRESET, PRODUCT, VENDOR
from hexacell.errors import DeviceError, FileError

ABOUT = """[FileInfo]
FileName=encoder.eds
FileVersion=1
EDSVersion=4.0

[DeviceInfo]
VendorName=Maker
VendorNumber={vendor}
ProductNumber=8
SimpleBootUpSlave=1
NrOfRXPDO=0
NrOfTXPDO=2

[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1018

[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2

[OptionalObjects]
SupportedObjects=2
1=0x6000
2=0x6003
"""
ENTRIES = (
    *(("1000", "Device type", "0x0007", "{kind}"), ("1018sub0", "Highest sub-index", "0x0005", "1")),
    *(("1018sub1", "Vendor", "0x0007", ""), ("6000", "Operating parameters", "0x0006", "0")),
    ("6003", "Preset", "0x0004", "-5"),
)
"""Sections of variables: names, types, and values as delivered."""

for section, name, of_type, value in ENTRIES:
    ABOUT += f"\n[{section}]\nParameterName={name}\nObjectType=0x7\nDataType={of_type}\nAccessType=rw\n"
    ABOUT += f"DefaultValue={value}\n" if value else ""


@pytest.fixture
def sheet(tmp_path: Path):
    """Writes a file; the raw nodes are vendor 0x99 and have no product."""

    def write(vendor: str = "0x99", kind: str = "0x00080196") -> Path:
        text = ABOUT.format(vendor=vendor, kind=kind).replace("ProductNumber=8\n", "")
        (tmp_path / "encoder.eds").write_text(text)
        return tmp_path / "encoder.eds"

    return write


def test_its_values_are_those_that_a_node_sends_and_names_in_any_encoding(tmp_path: Path) -> None:
    text = ABOUT.format(vendor="0x99", kind="0x00080196").replace("Maker", "M\u00e4ker")
    (tmp_path / "encoder.eds").write_text(text, encoding="latin-1")
    values = read_data_sheet(tmp_path / "encoder.eds").values
    assert (values[DEVICE_TYPE], values[VENDOR], values[PRODUCT]) == (0x0008_0196, 0x99, 8)
    assert values[PRESET] == 2**32 - 5


async def test_devices_that_are_as_delivered_have_no_remark(raw, make_bank, sheet) -> None:
    bank = make_bank(eds=str(sheet()))
    assert {identity.remark for identity in await bank.open()} == {""}


async def test_a_setting_that_was_changed_is_told_beside_a_warning(raw, make_bank, sheet) -> None:
    raw.nodes[3].objects[0x6000, 0] = b"\x08\0"
    raw.nodes[3].objects[0x6505, 0] = b"\x04\0"
    bank = make_bank(eds=str(sheet()))
    remarks = [identity.remark for identity in await bank.open()]
    await bank.close()
    assert remarks[2].startswith("it reports a warning: object 6505h:0 is 0x0004; operating parameters 8")
    assert set(remarks[:2] + remarks[3:]) == {""}


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ({"vendor": "0x12"}, "its vendor is 0x99, the file says 0x12"),
        ({"kind": "0x000A0196"}, "its device type is 0x80196, the file says 0xA0196"),
    ],
)
async def test_another_device_is_refused_by_its_leg(raw, make_bank, sheet, file, told) -> None:
    bank = make_bank(eds=str(sheet(**file)))
    with pytest.raises(DeviceError, match=f"is not the device of encoder.eds: {told}") as refused:
        await bank.open()
    assert refused.value.subject == "encoder of leg 1 (node 1)"


@pytest.mark.parametrize("text", ["", "nothing", "[FileInfo]\n", "[1000]\nParameterName=x\n", "\0\1\2"])
def test_what_is_no_such_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "other.eds").write_text(text)
    with pytest.raises(FileError, match=r"other.eds: is no EDS file of an encoder"):
        read_data_sheet(tmp_path / "other.eds")


def changed(old: str, new: str) -> str:
    text = ABOUT.format(vendor="0x99", kind="0x00080196")
    assert old in text
    return text.replace(old, new)


STRAY = "[Comments]\nLines=2\nLine1=of\ntwo lines\n[DeviceInfo]\nPDOMapping=\nGranularity=no\n"


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (changed("[FileInfo]", f"{STRAY}[FileInfo]"), "utf-8"),
        (changed("SimpleBootUpSlave=1", "Baud=010\nPDOMapping=\nRevisionNumber=x"), "utf-8"),
        (changed("DefaultValue=-5", "DefaultValue=-05"), "utf-8"),
        (changed("[6003]", "[6003]\n[6003]\nLowLimit=$NODEID+1"), "utf-8"),
        (changed("VendorNumber=0x99", "VendorNumber = 153 ; decimal"), "utf-8-sig"),
        (changed("[1018sub1]", "[1018SUB1]").replace("DefaultValue", "defaultvalue"), "latin-1"),
    ],
)
def test_what_is_not_compared_is_not_looked_at(tmp_path: Path, text: str, encoding: str) -> None:
    (tmp_path / "encoder.eds").write_text(text, encoding=encoding)
    values = read_data_sheet(tmp_path / "encoder.eds").values
    found = [values[entry] for entry in (DEVICE_TYPE, VENDOR, PRODUCT, PRESET)]
    assert found == [0x0008_0196, 0x99, 8, 2**32 - 5]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("DefaultValue=-5", "DefaultValue=five", r":\d+: has 'five' in section \[6003\]"),
        ("DefaultValue=-5", "DefaultValue -5", r":\d+: has 'DefaultValue -5' in section \[6003\]"),
        ("DefaultValue=0x00080196", "DefaultValue=010", r":\d+: has '010' in section \[1000\]"),
        ("VendorNumber=0x99", "VendorNumber=0x9Z", r":\d+: has '0x9Z' in section \[deviceinfo\]"),
    ],
)
def test_a_value_that_is_compared_and_no_number_is_named_with_its_line(tmp_path, old, new, told) -> None:
    text = changed(old, new)
    (tmp_path / "encoder.eds").write_text(text)
    with pytest.raises(FileError, match=told) as refused:
        read_data_sheet(tmp_path / "encoder.eds")
    assert text.splitlines()[(refused.value.line or 0) - 1] == new


@hypothesis_settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    place=st.integers(0, len(ABOUT)),
    length=st.integers(0, 40),
    piece=st.text(alphabet="[]=\n0x9zA\u00e4%$", max_size=12),
)
def test_damage_anywhere_gives_plain_errors_only(tmp_path, place, length, piece) -> None:
    text = ABOUT.format(vendor="0x99", kind="0x00080196")
    (tmp_path / "encoder.eds").write_text(text[:place] + piece + text[place + length :])
    with suppress(FileError):
        read_data_sheet(tmp_path / "encoder.eds")
