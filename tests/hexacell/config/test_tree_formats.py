"""Configs in JSON, YAML and URDF: only numbers change, and what cannot be rewritten safely is refused."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.config.data_files import DataFile, JsonFile
from hexacell.config.interface import ConfigFormat
from hexacell.config.urdf import UrdfOrigins
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS as PARAMETERS
from hexacell.kinematics.mechanisms.rotary_cranks import ROTARY_CRANKS_PARAMETERS

SIGNS = [1, 1, 1, -1, -1, -1]
NAMES = {"S": "legs.{index}.rail.{component}", "B": "legs.{index}.joint.{axis}", "l": "legs.{index}.length"}
JOINTS = {"S": "rail_{leg}/{component}", "B": "ball_{leg}/{component}", "l": "rod_{leg}/z"}
DRAWN = {name: 10.0 + 7.25 * number for number, name in enumerate(PARAMETERS.names)}


def tree(values: dict[str, float]) -> dict[str, Any]:
    return {
        "name": "robot: 1.0",
        "legs": [
            {
                "rail": {axis: values[f"S{leg}{axis}"] for axis in "xyz"},
                "joint": [values[f"B{leg}{axis}"] for axis in "xyz"],
                "length": values[f"l{leg}"],
            }
            for leg in range(1, 7)
        ],
    }


def as_json(values: dict[str, float]) -> str:
    return json.dumps(tree(values), indent="\t")


def as_yaml(values: dict[str, float]) -> str:
    lines = ["# made by hand", 'name: "robot: 1.0"  # 2.0', "legs:"]
    for leg in tree(values)["legs"]:
        lines += [
            f"  - rail: {{x: {leg['rail']['x']}, y: {leg['rail']['y']},",
            f"           z: {leg['rail']['z']}}}",
        ]
        lines += [
            "    joint:",
            *(f"    - {one}   # \u00b5" for one in leg["joint"]),
            f"    length: {leg['length']}",
        ]
    return "\n".join(lines) + "\n"


def as_urdf(values: dict[str, float]) -> str:
    lines = ['<?xml version="1.0"?>', "<!-- <joint name='rail_1'> -->", '<robot name="r\u00f6bot">']
    for leg in range(1, 7):
        for joint, names in (
            ("rail", [f"S{leg}{a}" for a in "xyz"]),
            ("ball", [f"B{leg}{a}" for a in "xyz"]),
        ):
            xyz = "  ".join(f"{values[name] / 1000:.7f}" for name in names)
            lines += [
                f'  <joint name="{joint}_{leg}" type="ball">',
                f'    <origin rpy="0 0 0"\n xyz="{xyz}"/>',
                "  </joint>",
            ]
        rod = f"{values[f'l{leg}'] / 1000:.7f}"
        lines += [f"<joint type='fixed' name='rod_{leg}'><origin xyz='0 0 {rod}' /></joint>"]
    return "\n".join([*lines, '<link name="l"><visual><origin xyz="9 9 9"/></visual></link>', "</robot>"])


@dataclass(frozen=True)
class Kind:
    form: ConfigFormat
    write: Callable[[dict[str, float]], str]


OPTIONS = {"names": NAMES, "branch": SIGNS}
KINDS = {
    "json": Kind(JsonFile(PARAMETERS, OPTIONS), as_json),
    "yaml": Kind(DataFile(PARAMETERS, OPTIONS), as_yaml),
    "urdf": Kind(UrdfOrigins(PARAMETERS, {"names": JOINTS, "branch": SIGNS}), as_urdf),
}
BY_NAME = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)


@BY_NAME
def test_all_numbers_are_read(kind: Kind) -> None:
    found = kind.form.read(kind.write(DRAWN), None)
    assert found.values == pytest.approx(DRAWN, abs=1e-9)
    assert found.branch == tuple(SIGNS)


@BY_NAME
@given(changes=st.dictionaries(st.sampled_from(PARAMETERS.names), st.integers(1, 900_000_000), max_size=5))
def test_a_write_changes_these_numbers_and_nothing_else(kind: Kind, changes: dict[str, int]) -> None:
    text, new = kind.write(DRAWN), DRAWN | {name: value * 1e-6 for name, value in changes.items()}
    written = kind.form.rewrite(text, new)
    assert kind.form.read(written, None).values == pytest.approx(new, abs=1e-6)
    assert len(written.splitlines()) == len(text.splitlines())
    assert kind.form.rewrite(text, DRAWN) == text


FIRST = f"{DRAWN['S1x']}"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace(f"x: {FIRST}", f"x: '{FIRST}'"), "is text, not a number"),
        (lambda text: text.replace(f"x: {FIRST}", "x: .nan"), "'.nan' is not a number"),
        (lambda text: text.replace(f"x: {FIRST}", "x: 1_000.0"), "is not a number"),
        (lambda text: text.replace(f"x: {FIRST}", "x: 010"), "octal"),
        (lambda text: text.replace(f"x: {FIRST}", f"x: {FIRST}, x: 2.0"), "a second time, after line 4"),
        (lambda text: text.replace(f"x: {FIRST}", f"x: &a {FIRST}, w: *a"), "by an alias"),
        (lambda text: "w: &a 5.0\n" + text.replace(f"x: {FIRST}", "x: *a"), "by an alias"),
        (
            lambda text: text.replace("rail: {", "rail: &a {", 1) + "tool: *a\n",
            "legs.0.rail is used .* by an alias",
        ),
        (lambda text: "legs: [{}]\n" + text, "legs is there a second time, after line 1"),
        (lambda text: text.replace(FIRST, f"!!float {FIRST}"), "is not a number"),
        (lambda text: "loop: &a [*a]\n", "nothing at legs.0.rail.x"),
        (
            lambda text: "w: &a {x: 5.0}\n" + text.replace(f"x: {FIRST}", "<<: *a"),
            "nothing at legs.0.rail.x",
        ),
        (lambda text: text + "---\n{}\n", "cannot be read as YAML"),
        (lambda text: text.replace("legs:", "legs: ["), "cannot be read as YAML"),
        (lambda text: "[" * 5000, "cannot be read as YAML"),
        (lambda text: "", "nothing at legs.0.rail.x"),
    ],
)
def test_yaml_that_cannot_be_rewritten_is_refused(change: Callable[[str], str], words: str) -> None:
    with pytest.raises(FileError, match=words):
        KINDS["yaml"].form.read(change(as_yaml(DRAWN)), None)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (FIRST, f'"{FIRST}"', "is text, not a number"),
        (FIRST, "NaN", "'NaN' is not a number"),
        (FIRST, "null", "'null' is not a number"),
        (f"{FIRST},", f'{FIRST},\n"x": 1,', "a second time"),
        ("{", '{"legs": [],', "legs is there a second time, after line 1"),
        ("{", "{ // a remark\n", "cannot be read as JSON"),
    ],
)
def test_json_that_cannot_be_rewritten_is_refused(old: str, new: str, words: str) -> None:
    with pytest.raises(FileError, match=words):
        KINDS["json"].form.read(as_json(DRAWN).replace(old, new, 1), None)


X = f"{DRAWN['S1x'] / 1000:.7f}"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (X, "${x}", r"'\$\{x\}' is not a number"),
        (X, "${x + 2 * y}", "is not a number"),
        (X, "", "has not three numbers"),
        (X, "&#49;", "has not three numbers"),
        (f'xyz="{X}', f'wxyz="{X}', "no joint has an origin rail_1/x"),
        ("</robot>", "<joint name='rail_1'><origin xyz='0 0 0'/></joint></robot>", "a second time"),
        ('<robot name="r\u00f6bot">', "<!DOCTYPE robot [<!ENTITY a '1'>]><robot>", "has no DOCTYPE"),
        ("rail_2", "rail_1", "a second time, after line"),
        ("rail_1", "rail_one", "no joint has an origin rail_1/x"),
        ("</robot>", "", "cannot be read as XML"),
    ],
)
def test_urdf_that_cannot_be_rewritten_is_refused(old: str, new: str, words: str) -> None:
    text = as_urdf(DRAWN)
    place = text.index("-->") if old.startswith("rail") else 0
    with pytest.raises(FileError, match=words):
        KINDS["urdf"].form.read(text[:place] + text[place:].replace(old, new, 1), None)


@pytest.mark.parametrize("element", ["xacro:macro", "xacro:if", "xacro:unless"])
def test_what_may_not_be_there_once_is_refused(element: str) -> None:
    text = (
        as_urdf(DRAWN)
        .replace('name="r\u00f6bot">', f"><{element}>")
        .replace("</robot>", f"</{element}></robot>")
    )
    with pytest.raises(FileError, match=f"the joint rail_1 is inside <{element}>"):
        KINDS["urdf"].form.read(text, None)


def test_angles_of_origins_are_radians_and_joints_of_others_are_no_concern() -> None:
    options = {"names": {"zero": "drive_{leg}/yaw"}, "branch": SIGNS}
    form = UrdfOrigins(ROTARY_CRANKS_PARAMETERS, options, is_part=True)
    drives = (f"<joint name='drive_{leg}'><origin rpy='0 0 {leg / 100}'/></joint>" for leg in range(1, 7))
    text = "".join(["<robot><joint name='tool'><origin rpy='1 1 1'/></joint>", *drives, "</robot>"])
    found = form.read(text, None).values
    assert found == pytest.approx({f"zero{leg}": math.degrees(leg / 100) for leg in range(1, 7)})
    new = {name: value + 1.0 for name, value in found.items()}
    assert form.read(form.rewrite(text, new), None).values == pytest.approx(new, abs=1e-7)


def test_a_unit_must_be_one() -> None:
    with pytest.raises(UsageError, match="unit_mm"):
        UrdfOrigins(PARAMETERS, {"names": JOINTS, "branch": SIGNS, "unit_mm": 0})


def test_a_branch_must_be_given() -> None:
    with pytest.raises(UsageError, match="branch"):
        JsonFile(PARAMETERS, {"names": NAMES})
