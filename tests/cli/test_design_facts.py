"""``hexacell cell validate`` says what is wrong with a design as a whole once, not of every pose."""

import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config

HEXAGLIDE, PLATFORM = "simulated-hexaglide", "gough-stewart"
NEXT = [5, 0, 1, 2, 3, 4]


def rows(text, name, change):
    """The text with other rows in each list of this name that is one row a line."""
    pattern = re.compile(rf"^{name} = \[\n((?:.*\n)*?)\]\n", re.MULTILINE)
    assert pattern.search(text)

    def changed(match):
        values = np.array(tomllib.loads(f"v = [{match[1]}]")["v"], dtype=float)
        return f"{name} = {np.round(change(values), 6).tolist()}\n"

    return pattern.sub(changed, text)


def in_rows(name, change):
    return lambda text: rows(text, name, change)


def instead(old, new):
    def changed(text):
        assert old in text
        return text.replace(old, new, 1)

    return changed


def with_columns(columns, change):
    def changed(values):
        values[:, columns] = change(values[:, columns])
        return values

    return changed


def turned(values):
    return values[NEXT]


def like_base(_):
    base = tomllib.loads(bundled_config(PLATFORM).read_text())["robot"]["nominal"]["base"]
    return np.array(base) * [0.4, 0.4, 0.0] + [0.0, 0.0, -80.0]


def first_twice(values):
    return values[[0, 0, 2, 3, 4, 5]]


TILTS = slice(3, 6)
CASES = {
    "branch": (
        HEXAGLIDE,
        [],
        [instead("[-1, -1, -1, 1, 1, 1]", "[1, 1, 1, -1, -1, -1]")],
        ["branch is 1 1 1 -1 -1 -1, and with -1 -1 -1 1 1 1", "can take 0 of 16 stated poses, then 16"],
    ),
    "order of the legs": (
        PLATFORM,
        [],
        [in_rows("base", turned), in_rows("platform", turned)],
        ["the legs are in another order than in", "legs 1 to 6 of the drawing are 2 3 4 5 6 1 there"],
    ),
    "order of the platform in the config": (
        HEXAGLIDE,
        [],
        [in_rows("B", turned)],
        ["the joints on the platform 1 to 6 of the drawing are 2 3 4 5 6 1 there"],
    ),
    "order of the platform in both": (
        PLATFORM,
        [in_rows("platform", turned)],
        [in_rows("platform", turned)],
        ["the joints on the platform are in another order than the legs: they would fit in the order 2 3"],
    ),
    "similar hexagons": (
        PLATFORM,
        [in_rows("platform", like_base)],
        [in_rows("platform", like_base)],
        ["the design is singular everywhere", "the hexagons of base and platform are similar"],
    ),
    "joints in common": (
        PLATFORM,
        [in_rows("base", first_twice), in_rows("platform", first_twice)],
        [in_rows("base", first_twice), in_rows("platform", first_twice)],
        ["the design is singular everywhere", "legs 1 and 2 have both joints in common"],
    ),
    "joint limits in metres": (
        PLATFORM,
        [instead("joint_max_mm = 460.0", "joint_max_mm = 0.46")],
        [],
        ["joint_max_mm = 0.46 looks like metres: 100% of the stated poses exceed it", "Write millimetres"],
    ),
    "axis limits in metres": (
        PLATFORM,
        [instead("turn_deg = 40.0", "turn_deg = 40.0\naxes = { z = [0.6, 0.9] }")],
        [],
        ["z = [0.6, 0.9] looks like metres"],
    ),
    "tilt in radians": (
        HEXAGLIDE,
        [instead("tilt_deg = 45.0", "tilt_deg = 0.785")],
        [],
        ["tilt_deg = 0.785 looks like radians", "Write degrees"],
    ),
    "cone in radians": (
        HEXAGLIDE,
        [instead("base_cone_deg = 45.0", "base_cone_deg = 0.785")],
        [],
        ["base_cone_deg = 0.785 looks like radians. Write degrees"],
    ),
    "cone of another joint": (
        HEXAGLIDE,
        [instead("base_cone_deg = 45.0", "base_cone_deg = 0.5")],
        [],
        ["all 16 stated poses are out of reach", "Correct [limits.passive_joints] or leg_distance_mm"],
    ),
    "task in radians": (
        HEXAGLIDE,
        [in_rows("poses", with_columns(TILTS, lambda deg: np.round(np.radians(deg), 3)))],
        [],
        ["the angles of the task poses look like radians: -0.349 would be -20 deg"],
    ),
    "points in metres": (
        HEXAGLIDE,
        [
            in_rows("points", lambda mm: mm / 1000.0),
            in_rows("poses", with_columns(slice(3), lambda mm: mm / 1000.0)),
            instead("first_seat = [-150.0, 0.0, 500.0]", "first_seat = [-0.15, 0.0, 0.5]"),
        ],
        [],
        ["the points look like metres"],
    ),
    "config in metres": (
        PLATFORM,
        [],
        [in_rows(name, lambda mm: mm / 1000.0) for name in ("base", "platform", "offset")],
        ["look like metres: in the other file they are 1000 times as large"],
    ),
    "out of reach": (
        PLATFORM,
        [
            in_rows("points", with_columns([2], lambda mm: mm + 600.0)),
            in_rows("poses", with_columns([2], lambda mm: mm + 600.0)),
        ],
        [],
        ["all 14 stated poses are out of reach", "mm along z: there the robot takes them"],
    ),
}


def written(folder: Path, name, of_cell=(), of_config=()):
    paths = [folder / "cell.toml", folder / f"{name}.controller.toml"]
    for path, changes in zip(paths, (of_cell, of_config), strict=True):
        source = bundled_config(name) if path is paths[0] else bundled_config(name).parent / path.name
        shutil.copy(source, path)
        for change in changes:
            path.write_text(change(path.read_text()))
    return paths[0]


@pytest.mark.parametrize("case", CASES)
def test_a_fact_about_the_design_is_one_mistake(typed_here, tmp_path, case):
    name, of_cell, of_config, words = CASES[case]
    cell = written(tmp_path, name, of_cell, of_config)
    outcome = typed_here("cell", "validate", cell)
    assert (outcome.code, outcome.err.count("\n")) == (2, 1), outcome.err
    assert all(word in outcome.err for word in words), outcome.err
    assert re.search(r"\.toml(:\d+)?: ", outcome.err)


def test_small_tilts_of_a_task_are_no_radians(typed_here, tmp_path):
    tilts = with_columns(TILTS, lambda deg: np.round(deg / 40.0, 3))
    cell = written(tmp_path, PLATFORM, [in_rows("poses", tilts)])
    assert typed_here("cell", "validate", cell).code == 0
