"""A geometry in several files: each parameter in one of them, whichever."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexacell.config.layout import ConfigLayout, FormatOfFile, controller_geometry
from hexacell.config.line_templates import LineTemplates
from hexacell.config.linuxcnc_hal import HalPins
from hexacell.config.linuxcnc_ini import LinuxcncIni
from hexacell.config.toml_format import NativeToml
from hexacell.errors import FileError, HexacellError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from tests.several_config_files import LAYOUT, drawn_geometry, hexapod_cell, write_config

SIGNS = [1, 1, 1, -1, -1, -1]
NAMES = HEXAGLIDE_PARAMETERS.names
HAL, INI, LINES, TOML = "linuxcnc-hal", "linuxcnc-ini", "template", "toml"


def part(name: str, **options):
    kinds: dict[str, Any] = {HAL: HalPins, INI: LinuxcncIni, LINES: LineTemplates, TOML: NativeToml}
    return FormatOfFile(name, kinds[name](HEXAGLIDE_PARAMETERS, options, is_part=True))


TOKENS = {name: f"{100 + number}.5" for number, name in enumerate(NAMES)}
RODS = [TOKENS[f"l{leg}"] for leg in range(1, 7)]
THIRD = {
    LINES: (
        {"lines": ["ROD[{leg}] := {l};"]},
        [f"ROD[{leg}] := {rod};" for leg, rod in enumerate(RODS, 1)],
    ),
    TOML: ({}, ["[geometry]", f"l = [{', '.join(RODS)}]  # rods", "[drives]", "gain = 2.0"]),
}


def hal_row(name: str) -> str:
    one = HEXAGLIDE_PARAMETERS.parameters[NAMES.index(name)]
    pin = ".".join(filter(None, (one.kind.symbol.lower(), str(one.leg - 1), one.component)))
    return f"setp genhexkins.{pin} {TOKENS[name]} # {name}"


def ini_row(name: str) -> str:
    return f"{name.upper()} = {TOKENS[name]}"


@pytest.fixture(params=[None, LINES, TOML])
def spread(request) -> tuple[ConfigLayout, tuple[str, ...]]:
    """Sliders in a HAL file but for one number, the others in an INI file, the rods perhaps in a third."""
    in_hal = [name for name in NAMES if name.startswith("S") and name != "S4y"]
    in_ini = [name for name in NAMES if name not in in_hal and not (request.param and name[0] == "l")]
    formats = [part(HAL, branch=SIGNS), part(INI)]
    rows = [
        ["loadrt trivkins", *map(hal_row, in_hal)],
        ["[GEOMETRY]", *map(ini_row, in_ini), "[HAL]", "HALFILE = a.hal", "HALFILE = b.hal"],
    ]
    if request.param:
        options, lines = THIRD[request.param]
        formats.append(part(request.param, **options))
        rows.append(lines)
    return ConfigLayout(HEXAGLIDE_PARAMETERS, tuple(formats)), tuple("\r\n".join(one) for one in rows)


def written(folder: Path, texts: tuple[str, ...]) -> tuple[Path, ...]:
    paths = tuple(folder / f"config-{number}" for number, _ in enumerate(texts))
    for path, text in zip(paths, texts, strict=True):
        path.write_bytes(text.encode())
    return paths


def test_numbers_are_read_from_their_files_and_written_where_they_stand(tmp_path, spread) -> None:
    layout, texts = spread
    found = layout.read(*written(tmp_path, texts))
    assert found.branch == tuple(SIGNS)
    assert found.geometry.vector.tolist() == [float(TOKENS[name]) for name in NAMES]
    assert layout.rewrite(texts, found.geometry) == texts
    new, expected = found.geometry.vector.copy(), "\0".join(texts)
    for name in ("S2x", "S4y", "B3z", "l5"):
        new[NAMES.index(name)] += 1.25
        expected = expected.replace(TOKENS[name], f"{float(TOKENS[name]) + 1.25}")
    assert layout.rewrite(texts, Geometry(HEXAGLIDE_PARAMETERS, new)) == tuple(expected.split("\0"))


@pytest.mark.parametrize("name", ["S2x", "S4y"])
def test_a_parameter_in_two_files_or_in_none_is_named(tmp_path, spread, name) -> None:
    layout, (hal, ini, *others) = spread
    both = (f"{hal}\r\n{hal_row(name)}", ini, *others)
    if hal_row(name) in hal:
        both = (hal, ini.replace("[GEOMETRY]", f"[GEOMETRY]\r\n{ini_row(name)}"), *others)
    neither = (hal.replace(hal_row(name), ""), ini.replace(ini_row(name), ""), *others)
    with pytest.raises(FileError, match=rf"^\S+: {name} is in config-\d and in config-\d"):
        layout.read(*written(tmp_path, both))
    with pytest.raises(FileError, match=f"{name} is in file"):
        layout.rewrite(both, Geometry(HEXAGLIDE_PARAMETERS, np.full(42, 2.0)))
    with pytest.raises(FileError, match=rf"^\S+: {name} is in none of the files config-0 and config-1"):
        layout.read(*written(tmp_path, neither))


@pytest.mark.parametrize("where", [(), (HAL, INI)])
def test_the_branch_is_in_one_of_them(tmp_path, where) -> None:
    formats = tuple(part(one, **({"branch": SIGNS} if one in where else {})) for one in (HAL, INI))
    texts = ("loadrt trivkins", "\n".join(["[GEOMETRY]", *map(ini_row, NAMES)]))
    with pytest.raises(FileError, match="branch is in"):
        ConfigLayout(HEXAGLIDE_PARAMETERS, formats).read(*written(tmp_path, texts))


def test_a_pin_set_to_a_variable_of_the_ini_file_is_in_that_file_alone(tmp_path) -> None:
    hal, ini = write_config(tmp_path)
    hal.write_text(f"{hal.read_text()}setp genhexkins.offset.0 [JOINT_0]HOME_OFFSET\n")
    assert LAYOUT.read(hal, ini).geometry.vector == pytest.approx(drawn_geometry().vector, abs=0.0)


@pytest.mark.parametrize(("place", "value"), [(0, np.nan), (20, np.inf), (41, 0.0), (36, -700.0)])
def test_an_unphysical_geometry_is_written_into_none(place, value) -> None:
    text = "\n".join(["[GEOMETRY]", *map(ini_row, NAMES)])
    vector = np.full(42, 1.5)
    vector[place] = value
    layout = ConfigLayout(HEXAGLIDE_PARAMETERS, (part(INI, branch=SIGNS), part(HAL)))
    with pytest.raises(FileError, match=r"the new geometry has values.*Nothing was written"):
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
