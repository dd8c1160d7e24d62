"""A geometry in several files: each parameter in one of them, whichever."""

import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.loader import load_cell
from hexacell.config.layout import ConfigLayout, FormatOfFile
from hexacell.config.line_templates import LineTemplates
from hexacell.config.linuxcnc_hal import HalPins
from hexacell.config.linuxcnc_ini import LinuxcncIni
from hexacell.config.toml_format import NativeToml
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.robot.model import config_layout, controller_geometry
from tests.several_config_files import LAYOUT, drawn_geometry, hexapod_cell, write_config

SIGNS = [1, 1, 1, -1, -1, -1]
NAMES = HEXAGLIDE_PARAMETERS.names
HAL, INI, LINES, TOML = "linuxcnc-hal", "linuxcnc-ini", "template", "toml"


def part(name: str, **options):
    kinds = {HAL: HalPins, INI: LinuxcncIni, LINES: LineTemplates, TOML: NativeToml}
    return FormatOfFile(name, kinds[name](HEXAGLIDE_PARAMETERS, options, is_part=True))


@dataclass(frozen=True)
class Spread:
    """Files with a part of the geometry each, and what every parameter is."""

    layout: ConfigLayout
    texts: tuple[str, ...]
    tokens: dict[str, str]


def hal_file(tokens: dict[str, str]) -> list[str]:
    parameters = [one for one in HEXAGLIDE_PARAMETERS.parameters if one.name in tokens]
    pins = [
        (".".join(filter(None, (one.kind.symbol.lower(), str(one.leg - 1), one.component))), one.name)
        for one in parameters
    ]
    return ["loadrt trivkins", *(f"setp genhexkins.{pin} {tokens[name]} # {name}" for pin, name in pins)]


def ini_file(tokens: dict[str, str]) -> list[str]:
    rows = [f"{name.upper()} = {token}" for name, token in tokens.items()]
    return ["[GEOMETRY]", *rows, "[HAL]", "HALFILE = a.hal", "HALFILE = b.hal"]


def lines_file(tokens: dict[str, str]) -> list[str]:
    return ["; rods", *(f"ROD[{leg}] := {tokens[f'l{leg}']};" for leg in range(1, 7))]


def toml_file(tokens: dict[str, str]) -> list[str]:
    rows = [f"l = [{', '.join(tokens[f'l{leg}'] for leg in range(1, 7))}]  # rods"]
    return ["[geometry]", *rows, "[drives]", "gain = 2.0"]


THIRD = {LINES: lines_file, TOML: toml_file}


@st.composite
def spreads(draw) -> Spread:
    """Numbers at will in a HAL and an INI file; the rods perhaps in a third file."""
    numbers = st.integers(1, 900_000).map(lambda value: f"{value / 1000:.3f}")
    tokens = {name: draw(numbers) for name in NAMES}
    third = draw(st.sampled_from([None, LINES, TOML]))
    elsewhere = {name for name in NAMES if third is not None and name.startswith("l")}
    in_hal = {name for name in NAMES if name not in elsewhere and draw(st.booleans())}
    branch = draw(st.sampled_from([HAL, INI]))
    formats = [part(one, **({"branch": SIGNS} if one == branch else {})) for one in (HAL, INI)]
    rows = [
        hal_file({name: tokens[name] for name in NAMES if name in in_hal}),
        ini_file({name: tokens[name] for name in NAMES if name not in in_hal | elsewhere}),
    ]
    if third is not None:
        formats.append(part(third, **({"lines": ["ROD[{leg}] := {l};"]} if third == LINES else {})))
        rows.append(THIRD[third](tokens))
    end = draw(st.sampled_from(["\n", "\r\n"]))
    return Spread(
        ConfigLayout(HEXAGLIDE_PARAMETERS, tuple(formats)), tuple(end.join(one) for one in rows), tokens
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    made: Path = tmp_path_factory.mktemp("spread")
    return made


def written(folder: Path, texts: tuple[str, ...]) -> tuple[Path, ...]:
    paths = tuple(folder / f"config-{number}" for number, _ in enumerate(texts))
    for path, text in zip(paths, texts, strict=True):
        path.write_bytes(text.encode())
    return paths


@given(spreads())
def test_every_number_is_read_and_a_write_of_the_same_is_byte_identical(folder, spread) -> None:
    found = spread.layout.read(*written(folder, spread.texts))
    assert found.branch == tuple(SIGNS)
    assert found.geometry.vector.tolist() == [float(spread.tokens[name]) for name in NAMES]
    assert spread.layout.rewrite(spread.texts, found.geometry) == spread.texts


@given(spreads(), st.data())
def test_a_write_changes_the_tokens_of_what_changed_and_nothing_else(folder, spread, data) -> None:
    found = spread.layout.read(*written(folder, spread.texts)).geometry
    rows = data.draw(st.lists(st.integers(0, 41), min_size=1, max_size=6, unique=True))
    new = found.vector.copy()
    new[rows] += 1.234567
    changed = spread.layout.rewrite(spread.texts, Geometry(HEXAGLIDE_PARAMETERS, new))
    assert spread.layout.read(*written(folder, changed)).geometry.vector == pytest.approx(new, abs=1e-6)
    pieces = (re.split(r"([^\s,=\[\];]+)", "\0".join(texts)) for texts in (spread.texts, changed))
    different = [one for one, other in zip_longest(*pieces) if one != other]
    assert sorted(different) == sorted(spread.tokens[NAMES[row]] for row in rows)


@given(spreads(), st.sampled_from(NAMES))
def test_a_parameter_in_two_files_or_in_none_is_named(folder, spread, name) -> None:
    hal, ini, *others = spread.texts
    pin = hal_file({name: "1.5"})[-1]
    if name.upper() + " =" in ini:
        without = re.sub(rf"(?m)^{name.upper()} = .*\n?", "", ini)
        neither, both = (hal, without, *others), (f"{hal}\n{pin}", ini, *others)
    else:
        twice = ini.replace("[GEOMETRY]", f"[GEOMETRY]\n{name.upper()} = 1.5")
        without = re.sub(rf"(?m)^{re.escape(pin.rsplit(' ', 3)[0])} .*\n?", "", hal)
        neither, both = (without, ini, *others), (hal, twice, *others)
    with pytest.raises(FileError, match=rf"^\S+: {name} is in config-\d and in config-\d"):
        spread.layout.read(*written(folder, both))
    with pytest.raises(FileError, match=f"{name} is in file"):
        spread.layout.rewrite(both, Geometry(HEXAGLIDE_PARAMETERS, np.full(42, 2.0)))
    if without not in {hal, ini}:
        with pytest.raises(FileError, match=rf"^\S+: {name} is in none of the files config-0 and config-1"):
            spread.layout.read(*written(folder, neither))


@pytest.mark.parametrize("where", [(), (HAL, INI)])
def test_the_branch_is_in_one_of_them(folder, where) -> None:
    formats = tuple(part(one, **({"branch": SIGNS} if one in where else {})) for one in (HAL, INI))
    tokens = dict.fromkeys(NAMES, "1.5")
    texts = tuple("\n".join(rows) for rows in (hal_file({}), ini_file(tokens)))
    with pytest.raises(FileError, match="branch is in"):
        ConfigLayout(HEXAGLIDE_PARAMETERS, formats).read(*written(folder, texts))


def test_a_pin_set_to_a_variable_of_the_ini_file_is_in_that_file_alone(tmp_path) -> None:
    hal, ini = write_config(tmp_path)
    hal.write_text(f"{hal.read_text()}setp genhexkins.offset.0 [JOINT_0]HOME_OFFSET\n")
    assert LAYOUT.read(hal, ini).geometry.vector == pytest.approx(drawn_geometry().vector, abs=0.0)


@pytest.mark.parametrize("value", [np.nan, -1.0e9])
def test_an_unphysical_geometry_is_written_into_none(value) -> None:
    text = "\n".join(ini_file(dict.fromkeys(NAMES, "1.5")))
    vector = np.full(42, 1.5)
    vector[41] = value
    layout = ConfigLayout(HEXAGLIDE_PARAMETERS, (part(INI, branch=SIGNS), part(HAL)))
    with pytest.raises(FileError, match="Nothing was written"):
        layout.rewrite((text, ""), Geometry(HEXAGLIDE_PARAMETERS, vector))


class TestTheCellFile:
    def test_names_the_files_and_their_limits_hold(self, tmp_path) -> None:
        cell = hexapod_cell(tmp_path)
        assert [path.name for path in cell.config_paths] == ["hexapod.hal", "hexapod.ini"]
        assert cell.taught_paths == cell.config_paths
        found = controller_geometry(cell)
        assert found.geometry.vector == pytest.approx(drawn_geometry().vector, abs=0.0)
        assert found.limits.joints == ((600.0, 1060.0),) * 6

    def test_a_file_twice(self, tmp_path) -> None:
        with pytest.raises(HexacellError, match=r"hexapod\.hal is named twice"):
            hexapod_cell(tmp_path, ('config = "hexapod.ini"', 'config = "hexapod.hal"'))

    def test_taught_for_one_of_two(self, tmp_path) -> None:
        edit = ("joints_include_zeros = true", 'joints_include_zeros = true\ntaught = "old.hal"')
        with pytest.raises(HexacellError, match="taught is stated for some of the files only"):
            hexapod_cell(tmp_path, edit)

    def test_taught_for_both(self, tmp_path) -> None:
        edits = (
            ("joints_include_zeros = true", 'joints_include_zeros = true\ntaught = "old.hal"'),
            ('config_format = "linuxcnc-ini"', 'config_format = "linuxcnc-ini"\ntaught = "old.ini"'),
        )
        cell = hexapod_cell(tmp_path, *edits)
        assert [path.name for path in cell.taught_paths] == ["old.hal", "old.ini"]

    def test_a_format_that_takes_the_whole_geometry_only(self, tmp_path, monkeypatch) -> None:
        cell = load_cell(hexapod_cell(tmp_path).path)
        monkeypatch.setattr("hexacell.robot.model.load", lambda *_: lambda *_: None)
        with pytest.raises(UsageError, match="'linuxcnc-hal' cannot have a part of the geometry only"):
            config_layout(cell.settings)
