"""Configs with one number a key: INI, HAL and line templates, generated with what an owner may add."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.config.interface import ConfigFormat, write_number
from hexacell.config.layout import ConfigLayout, FormatOfFile
from hexacell.config.line_templates import LineTemplates
from hexacell.config.linuxcnc_hal import HalPins
from hexacell.config.linuxcnc_ini import LinuxcncIni
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS

SIGNS = [1, 1, 1, -1, -1, -1]
INI = {"section": "HEXAGLIDE", "branch": "BRANCH{leg}"}
HAL = {"component": "hexaglidekins", "branch": SIGNS}
LINES = {"lines": ["JOINT[{leg}] := {{{S.x}, {S.y}, {S.z}}}", "B{index}: {B.x} {B.y} {B.z} {l} {branch}"]}

OWNERS_LINES = [
    "",
    "# S1X = 5.0, a remark",
    "; setp hexaglidekins.s.0.x 7",
    "#INCLUDE other.inc",
    "[DISPLAY]\nS1X = 9\nDISPLAY = linuxcncrsh --port 5007",
    "[HAL]\nHALFILE = a.hal\nHALFILE = b.hal\nPATH = /x=y",
    "net j0 joint.0.motor-pos-cmd => joint.0.motor-pos-fb",
    "JOINT[7] := {1.0, 2.0, 3.0}",
    "setp other.s.0.x 1.5",
    "\u00e4 \u00b5m",
]


def write_ini(number: Callable[[str], str], gap: str) -> list[str]:
    rows = [f"{name.upper()}{gap}={gap}{number(name)}" for name in HEXAGLIDE_PARAMETERS.names]
    return ["[HEXAGLIDE]", *rows, *(f"BRANCH{leg} = {sign}" for leg, sign in enumerate(SIGNS, 1)), "[EMC]"]


def write_hal(number: Callable[[str], str], gap: str) -> list[str]:
    pins = [
        (".".join(filter(None, (one.kind.symbol.lower(), str(one.leg - 1), one.component))), one.name)
        for one in HEXAGLIDE_PARAMETERS.parameters
    ]
    return [f"{gap}setp hexaglidekins.{pin} {gap}{number(name)}{gap} # {name}" for pin, name in pins]


def write_lines(number: Callable[[str], str], gap: str) -> list[str]:
    rows = []
    for leg, sign in enumerate(SIGNS, 1):
        joint = [number(f"S{leg}{axis}") for axis in "xyz"]
        ball = [number(f"B{leg}{axis}") for axis in "xyz"]
        rows.append(f"{gap}JOINT[{leg}] := {{{joint[0]}, {joint[1]}, {gap}{joint[2]}}}")
        rows.append(f"B{leg - 1}:{gap or ' '}{' '.join(ball)} {number(f'l{leg}')} {sign}{gap}")
    return rows


def one_file(form: ConfigFormat) -> ConfigLayout:
    return ConfigLayout(HEXAGLIDE_PARAMETERS, (FormatOfFile("a format", form),))


@dataclass(frozen=True)
class Kind:
    form: ConfigLayout
    write: Callable[[Callable[[str], str], str], list[str]]


KINDS = {
    "ini": Kind(one_file(LinuxcncIni(HEXAGLIDE_PARAMETERS, INI)), write_ini),
    "hal": Kind(one_file(HalPins(HEXAGLIDE_PARAMETERS, HAL)), write_hal),
    "template": Kind(one_file(LineTemplates(HEXAGLIDE_PARAMETERS, LINES)), write_lines),
}
BY_NAME = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)

lengths = st.floats(-900.0, 900.0).map(lambda value: round(value, 3))
spellings = st.sampled_from(
    [
        lambda value: f"{value:.3f}",
        lambda value: f"{value:+.4f}",
        lambda value: f"{value:.9e}",
        lambda value: repr(value).removesuffix("0") if repr(value).endswith(".0") else repr(value),
    ]
)
owners = st.lists(st.sampled_from(OWNERS_LINES), max_size=4)


@st.composite
def configs(draw) -> tuple[Kind, str, dict[str, str]]:
    kind = draw(st.sampled_from(list(KINDS.values())))
    values = {name: draw(lengths) for name in HEXAGLIDE_PARAMETERS.names}
    values |= {f"l{leg}": abs(values[f"l{leg}"]) + 1.0 for leg in range(1, 7)}
    spell = draw(spellings)
    tokens = {name: spell(value) for name, value in values.items()}
    body = kind.write(lambda name: tokens[name], draw(st.sampled_from(["", " ", "\t "])))
    before, after = draw(owners), draw(owners)
    end = draw(st.sampled_from(["\n", "\r\n"]))
    text = end.join([*before, *body, *after]).replace("\r\n", "\n").replace("\n", end)
    return kind, text + draw(st.sampled_from(["", end])), tokens


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Callable[[str], Path]:
    path: Path = tmp_path_factory.mktemp("configs") / "config"

    def write(text: str) -> Path:
        path.write_bytes(text.encode())
        return path

    return write


@given(configs())
def test_every_number_is_read_and_a_write_of_the_same_is_byte_identical(written, config) -> None:
    kind, text, tokens = config
    found = kind.form.read(written(text))
    assert found.branch == tuple(SIGNS)
    assert found.geometry.vector == pytest.approx([float(tokens[name]) for name in tokens], abs=0.0)
    assert kind.form.rewrite([text], found.geometry) == (text,)


@given(configs(), st.data())
def test_a_write_changes_the_tokens_of_what_changed_and_nothing_else(written, config, data) -> None:
    kind, text, tokens = config
    found = kind.form.read(written(text)).geometry
    rows = data.draw(st.lists(st.integers(0, 41), min_size=1, max_size=5, unique=True))
    new = found.vector.copy()
    new[rows] += 1.234567
    [changed] = kind.form.rewrite([text], Geometry(HEXAGLIDE_PARAMETERS, new))
    assert kind.form.read(written(changed)).geometry.vector == pytest.approx(new, abs=1e-6)
    pieces = re.split(r"([^\s,={}]+)", text), re.split(r"([^\s,={}]+)", changed)
    different = [(one, other) for one, other in zip(*pieces, strict=True) if one != other]
    names = [HEXAGLIDE_PARAMETERS.names[row] for row in rows]
    assert sorted(one for one, _ in different) == sorted(tokens[name] for name in names)
    assert {other for _, other in different} <= {write_number(new[row], 6) for row in rows}


@BY_NAME
def test_a_config_with_one_number_less_or_one_twice_is_refused(kind, written) -> None:
    body = kind.write(lambda _: "1.5", " ")
    place = next(n for n, line in enumerate(body) if "S1X" in line or "s.0.x" in line or "JOINT[1]" in line)
    with pytest.raises(FileError, match=r"no S1X in|the pin hexaglidekins\.s\.0\.x|like JOINT") as caught:
        kind.form.read(written("\n".join(body[:place] + body[place + 1 :])))
    assert caught.value.subject is not None
    with pytest.raises(FileError, match=rf"line {place + 1}\b") as caught:
        kind.form.read(written("\n".join([*body[: place + 1], body[place], *body[place + 1 :]])))
    assert caught.value.line == place + 2


@BY_NAME
@pytest.mark.parametrize("token", ["nan", "inf", "1e999", "0x10", "1_000", "1,5", "--1", "\u0661"])
def test_what_is_no_number_is_refused(kind, written, token) -> None:
    body = kind.write(lambda name: token if name in {"l1", "S2y"} else "1.5", " ")
    with pytest.raises(FileError):
        kind.form.read(written("\n".join(body)))


@BY_NAME
def test_a_length_that_is_not_above_zero_is_refused_with_its_line(kind, written) -> None:
    body = kind.write(lambda name: "-2.0" if name == "l3" else "1.5", " ")
    with pytest.raises(FileError, match="l3 is -2, but must be above zero") as caught:
        kind.form.read(written("\n".join(body)))
    assert "-2.0" in body[(caught.value.line or 0) - 1]


def test_an_inch_machine_keeps_a_nanometre(written) -> None:
    form = one_file(HalPins(HEXAGLIDE_PARAMETERS, HAL | {"unit_mm": 25.4}))
    text = "\n".join(write_hal(lambda _: "20.5", " "))
    geometry = form.read(written(text)).geometry
    assert geometry.vector == pytest.approx(np.full(42, 520.7), rel=1e-15)
    assert form.rewrite([text], geometry) == (text,)
    new = Geometry(HEXAGLIDE_PARAMETERS, geometry.vector + np.linspace(0.1, 0.2, 42))
    again = form.read(written(form.rewrite([text], new)[0])).geometry
    assert again.vector == pytest.approx(new.vector, abs=5e-7)


def test_corrections_are_written_beside_the_nominal_numbers(written) -> None:
    options = INI | {"corrections": {"S": "DS{leg}{COMPONENT}", "l": "DL{leg}"}}
    form = one_file(LinuxcncIni(HEXAGLIDE_PARAMETERS, options))
    rows = write_ini(lambda _: "100.0", " ")
    zeros = [f"DS{leg}{axis} = 0" for leg in range(1, 7) for axis in "XYZ"]
    zeros += [f"DL{leg} = 0.5" for leg in range(1, 7)]
    text = "\n".join([rows[0], *zeros, *rows[1:]])
    geometry = form.read(written(text)).geometry
    assert geometry["l"] == pytest.approx(np.full(6, 100.5))
    new = geometry.vector.copy()
    new[[0, 20, 41]] += 0.25
    changed = form.rewrite([text], Geometry(HEXAGLIDE_PARAMETERS, new))[0].splitlines()
    different = {other for one, other in zip(text.splitlines(), changed, strict=True) if one != other}
    assert different == {"DS1X = 0.25", "DL6 = 0.75", "B1Z = 100.25"}


class TestWhatLinuxcncSees:
    """As ``inivar`` of LinuxCNC 2.9 answers, see ``linuxcnc``."""

    FORM = one_file(LinuxcncIni(HEXAGLIDE_PARAMETERS, INI))

    @pytest.mark.parametrize(
        ("inserted", "reason"),
        [
            ("[EMC]\n[HEXAGLIDE]", "it does not look into a second section"),
            ("[HEXAGLIDE", r"the line that begins its section has no ']'"),
            (" [HEXAGLIDE \t", r"the line that begins its section has no ']'"),
            ("# millimetres \\", "the line before ends with a backslash"),
            ("NOTE = of the\\", "the line before ends with a backslash"),
        ],
    )
    def test_a_variable_that_a_person_sees_and_it_does_not(self, written, inserted, reason) -> None:
        rows = write_ini(lambda _: "1.5", " ")
        text = "\n".join([*rows[:10], inserted, *rows[10:]])
        with pytest.raises(FileError, match=rf"does not see \[HEXAGLIDE\] S4X: {reason}") as caught:
            self.FORM.read(written(text))
        assert caught.value.line == 12 + inserted.count("\n")

    def test_another_case(self, written) -> None:
        rows = [row.replace("B1X", "b1x") for row in write_ini(lambda _: "1.5", " ")]
        with pytest.raises(FileError, match=r"there is no B1X in a section \[HEXAGLIDE\]"):
            self.FORM.read(written("\n".join(rows)))

    def test_a_variable_of_another_section_by_its_name(self, written) -> None:
        form = one_file(LinuxcncIni(HEXAGLIDE_PARAMETERS, INI | {"names": {"l": "JOINT_{index}/LENGTH"}}))
        rows = [row for row in write_ini(lambda _: "1.5", " ") if not re.match(r"L\d", row)]
        joints = [f"[JOINT_{n}]\nTYPE = LINEAR\nLENGTH = {n + 600}" for n in range(6)]
        found = form.read(written("\n".join([*rows, *joints])))
        assert found.geometry["l"].tolist() == [600, 601, 602, 603, 604, 605]


def test_a_pin_set_to_a_variable_names_the_other_format(written) -> None:
    rows = write_hal(lambda name: "[HEXAGLIDE]S1X" if name == "S1x" else "1.5", " ")
    with pytest.raises(FileError, match="a variable of the INI file") as caught:
        one_file(HalPins(HEXAGLIDE_PARAMETERS, HAL)).read(written("\n".join(rows)))
    assert "linuxcnc-ini" in (caught.value.action or "")


@pytest.mark.parametrize(
    ("form", "options", "words"),
    [
        (LinuxcncIni, {"section": "X"}, "have no branch"),
        (LinuxcncIni, {"branch": [1, 1, 1, 1, 1, 2]}, "branch"),
        (LinuxcncIni, INI | {"names": {"Q": "Q{leg}"}}, "'Q', which the mechanism has not"),
        (LinuxcncIni, INI | {"names": {"l": "L"}}, "two parameters are in 'L'"),
        (LinuxcncIni, INI | {"names": {"l": "L{leg.x}"}}, "is not a pattern"),
        (LinuxcncIni, INI | {"unit_mm": 0}, "unit_mm"),
        (LinuxcncIni, INI | {"sektion": "X"}, "sektion"),
        (LineTemplates, {"lines": ["{S.x} {S.y} {S.z} {branch}"]}, "B1x is in no line"),
        (LineTemplates, {"lines": LINES["lines"] + ["{S1x}"]}, "S1x is in more than one line"),
        (LineTemplates, {"lines": ["{S.w}"]}, "{S.w}, which is no parameter"),
        (LineTemplates, {"lines": ["{S.x"]}, "is not a line template"),
        (LineTemplates, LINES | {"names": {"S": "S"}}, "for other formats"),
    ],
)
def test_wrong_options_are_told_in_words(form, options, words) -> None:
    with pytest.raises(UsageError, match=re.escape(words)):
        form(HEXAGLIDE_PARAMETERS, options)
