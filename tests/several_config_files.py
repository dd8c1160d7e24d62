"""A Gough-Stewart platform as LinuxCNC has it: base and platform in a HAL file, zeros in the INI file."""

from pathlib import Path

from hexacell.cell.loader import Cell, load_cell
from hexacell.config.layout import ConfigLayout, FormatOfFile
from hexacell.config.linuxcnc_hal import HalPins
from hexacell.config.linuxcnc_ini import LinuxcncIni
from hexacell.config.toml_format import native_layout
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS
from tests.cli.cell_folder import CONFIGS

NAME = "gough-stewart"
ZEROS = {"names": {"offset": "JOINT_{index}/HOME_OFFSET"}}
LAYOUT = ConfigLayout(
    GOUGH_STEWART_PARAMETERS,
    (
        FormatOfFile("linuxcnc-hal", HalPins(GOUGH_STEWART_PARAMETERS, {}, is_part=True)),
        FormatOfFile("linuxcnc-ini", LinuxcncIni(GOUGH_STEWART_PARAMETERS, ZEROS, is_part=True)),
    ),
)
CONTROLLER = """\
config = "hexapod.hal"
config_format = "linuxcnc-hal"
joints_include_zeros = true

[[controller.further_files]]
config = "hexapod.ini"
config_format = "linuxcnc-ini"
config_options = { names = { offset = "JOINT_{index}/HOME_OFFSET" } }
"""


def hal_text(geometry: Geometry) -> str:
    """Pins of ``genhexkins``, among lines that are not theirs."""
    pins = [
        f"setp genhexkins.{kind}.{leg}.{axis} {value!r}  # leg {leg + 1}"
        for kind in ("base", "platform")
        for leg, joint in enumerate(geometry[kind].tolist())
        for axis, value in zip("xyz", joint, strict=True)
    ]
    return "\n".join(["loadrt [KINS]KINEMATICS", *pins, "setp genhexkins.screw-lead 0", ""])


def ini_text(geometry: Geometry) -> str:
    """Joints with zeros and limits, with Windows line ends."""
    joints = [
        f"[JOINT_{n}]\nMIN_LIMIT = 600\nMAX_LIMIT = 1060\nHOME_OFFSET = {zero!r}\n"
        for n, zero in enumerate(geometry["offset"].tolist())
    ]
    return "".join(["[HAL]\nHALFILE = hexapod.hal\nHALFILE = drives.hal\n", *joints]).replace("\n", "\r\n")


def drawn_geometry() -> Geometry:
    """That of the bundled cell's controller."""
    return native_layout(GOUGH_STEWART_PARAMETERS).read(CONFIGS / f"{NAME}.controller.toml").geometry


def write_config(folder: Path) -> tuple[Path, Path]:
    """The two files."""
    files = folder / "hexapod.hal", folder / "hexapod.ini"
    for path, text in zip(files, (hal_text(drawn_geometry()), ini_text(drawn_geometry())), strict=True):
        path.write_bytes(text.encode())
    return files


def hexapod_cell(folder: Path, *edits: tuple[str, str]) -> Cell:
    """The bundled cell, with the config in these two files."""
    write_config(folder)
    text = (CONFIGS / f"{NAME}.toml").read_text()
    begin, end = text.index('config = "'), text.index("# taught = ")
    text = text[:begin] + CONTROLLER + text[end:]
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / f"{NAME}.toml"
    path.write_text(text)
    return load_cell(path)
