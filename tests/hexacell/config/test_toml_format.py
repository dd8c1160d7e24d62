"""The native config: read with the line of every mistake, rewritten in its number tokens alone."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.config.interface import write_number
from hexacell.config.toml_format import native_layout
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.parameters import ParameterUnit
from hexacell.storage.toml_document import TomlDocument

FORMAT = native_layout(HEXAGLIDE_PARAMETERS)
HALF_A_NANOMETRE = 5e-7

AT_THE_TOP = [
    'note = "S = [[1, 2, 3]] # no comment"\n',
    "text = '''\n[geometry]\nS = [[1.0]]\nl = [2.0]\n'''\n",
    '"geometry.S" = 3.0\n',
    "geometry2 . S = [[1.0]]\n",
    "when = 1979-05-27 07:32:00 # 1979\n",
    "odd = [nan, 1_0, 0x1F, +1e5, {S = [1.0]}]\n",
    "#[geometry]\n# S = [[1.0]]\n",
]
AT_THE_END = [
    "[[tool]]\nname = 'x'\n[[tool]]\n[tool.geometry]\nS = [1.0]\n",
    "[other.geometry] # 5.0\nS = [[9.0]]\nl = nan\n",
    "[ geometry . extra ]\nS = 1.0\n",
    "\t \n# the end\n",
]


@dataclass(frozen=True)
class Layout:
    """One way for an owner to write the file; ``render`` fills in the number tokens."""

    style: str
    gap: str
    comma: str
    comment: str
    order: tuple[str, ...]
    top: str
    end: str
    newline: str
    mark: str

    def render(self, token: Callable[[str], str]) -> str:
        entries = [f"{name}{self.gap}={self.gap}{self._value(name, token)}" for name in self.order]
        if self.style == "header":
            body = "[geometry]\n" + "".join(f"{self.gap}{entry}{self.comment}\n" for entry in entries)
        elif self.style == "dotted":
            body = "".join(f"geometry.{entry}{self.comment}\n" for entry in entries)
        else:
            body = f"geometry{self.gap}= {{ {', '.join(entries)}{self.gap}}}{self.comment}\n"
        end = "" if self.style == "inline" else self.end
        return self.mark + (self.top + body + end).replace("\n", self.newline)

    def _value(self, name: str, token: Callable[[str], str]) -> str:
        if name == "branch":
            return "[1, 1,+1, -1, -1, -1]"
        if name == "l":
            return self._array([token(f"l{leg}") for leg in range(1, 7)])
        rows = [[token(f"{name}{leg}{axis}") for axis in "xyz"] for leg in range(1, 7)]
        return self._array([self._array(row) for row in rows])

    def _array(self, items: list[str]) -> str:
        return f"[{self.gap}" + self.comma.join(items) + f"{self.gap}]"


layouts = st.builds(
    Layout,
    style=st.sampled_from(["header", "dotted", "inline"]),
    gap=st.sampled_from(["", " ", "\t", "  \t"]),
    comma=st.sampled_from([",", ", ", " ,\t", ",\n    ", " # 1.0, ] and \"so\n , # 2.0 '\n"]),
    comment=st.sampled_from(["", "  # mm, [drawing] 4711.0", "\t#"]),
    order=st.permutations(["S", "B", "l", "branch"]).map(tuple),
    top=st.lists(st.sampled_from(AT_THE_TOP), unique=True).map("".join),
    end=st.tuples(
        st.lists(st.sampled_from(AT_THE_END), unique=True).map("".join),
        st.sampled_from(["", "# 1.0", "\t"]),
    ).map("".join),
    newline=st.sampled_from(["\n", "\r\n"]),
    mark=st.sampled_from(["", "\ufeff"]),
)
plain = Layout("header", " ", ", ", "", ("S", "B", "l", "branch"), "", "", "\n", "")

spellings = st.one_of(
    st.floats(1e-3, 1e4).map(repr),
    st.floats(1e-3, 1e4).map("{:.9E}".format),
    st.floats(1e-3, 1e4).map("+{:.4f}".format),
    st.integers(1, 2000).map(str),
    st.integers(1, 2000).map(hex),
    st.sampled_from(["1_000.5", "1_0e-0_1", "7e2", "12_3", "0.000_000_1", "0b11"]),
)
moves = st.one_of(st.just(0.0), st.floats(-4e-7, 4e-7), st.floats(-7.0, 7.0), st.just(1e-6))


@st.composite
def tokens_and_values(draw: st.DrawFn) -> tuple[list[str], np.ndarray]:
    """42 numbers as an owner spells them, and the geometry that is to replace them."""
    few = draw(st.lists(st.tuples(spellings, moves), min_size=1, max_size=6))
    pairs = [few[index % len(few)] for index in range(len(HEXAGLIDE_PARAMETERS))]
    values = np.array([tomllib.loads(f"x = {text}")["x"] + move for text, move in pairs])
    # A length stays above zero when it is written with six decimals.
    values[36:] = np.abs(values[36:]) + 1e-6
    return [text for text, _ in pairs], values


def expected_token(old: str, new: float) -> str:
    """What must stand in the new text, worked out with decimals instead of formats."""
    if abs(new - tomllib.loads(f"x = {old}")["x"]) <= HALF_A_NANOMETRE:
        return old
    rounded = Decimal(new).quantize(Decimal("1e-6"))
    shortest = rounded.normalize() + 0 if rounded else Decimal(0)
    return f"{shortest:f}" if "." in f"{shortest:f}" else f"{shortest:f}.0"


def token_by_name(tokens: list[str]) -> Callable[[str], str]:
    return dict(zip(HEXAGLIDE_PARAMETERS.names, tokens, strict=True)).__getitem__


@given(layouts, tokens_and_values())
def test_only_number_tokens_change_and_only_where_the_values_do(layout, numbers) -> None:
    old, new = numbers
    text, geometry = layout.render(token_by_name(old)), Geometry(HEXAGLIDE_PARAMETERS, new)
    same = Geometry(HEXAGLIDE_PARAMETERS, [tomllib.loads(f"x = {token}")["x"] for token in old])
    assert FORMAT.rewrite([text], same) == (text,)
    expected = [expected_token(one, value) for one, value in zip(old, new.tolist(), strict=True)]
    [changed] = FORMAT.rewrite([text], geometry)
    assert changed == layout.render(token_by_name(expected))
    assert FORMAT.rewrite([changed], geometry) == (changed,)


@pytest.mark.parametrize(
    ("value", "token"),
    [(1000.0, "1000.0"), (-0.0, "0.0"), (-1e-9, "0.0"), (0.1 + 0.2, "0.3"), (1e22, "1" + "0" * 22 + ".0")],
)
def test_number_tokens(value: float, token: str) -> None:
    assert write_number(value, ParameterUnit.MM.decimals) == token


def test_the_branch_may_be_at_the_top(config: Path) -> None:
    lines = config.read_text().splitlines(keepends=True)
    [branch] = [line for line in lines if line.startswith("branch")]
    lines.remove(branch)
    config.write_text(branch + "".join(lines))
    assert FORMAT.read(config).branch == (1, 1, 1, -1, -1, -1)


GOOD = plain.render(token_by_name(["1.0"] * len(HEXAGLIDE_PARAMETERS)))
S, B, L, BRANCH = GOOD.splitlines()[1:5]
ROW = "[ 1.0, 1.0, 1.0 ]"


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("[geometry]", "[geometrie]", None, "section [geometry] is missing. Add it, with S, B, l, branch"),
        ("[geometry]", "geometry = 3\n[x]", 1, "'geometry' at the top of the file is 3, but"),
        ("[geometry]", "[[geometry]]", 1, "must be a section"),
        (S, "", 1, "'S' in [geometry] is missing"),
        (BRANCH, "", 1, "'branch' in [geometry] is missing"),
        (f"S = [ {ROW}, ", "S = [ ", 2, "'S' in [geometry] is a list of 5 items, but must be a list"),
        (
            f"S = [ {ROW}, {ROW}",
            f"\nS = [\n{ROW},[1.0]",
            4,
            "row 2 is a list of 1 item, but must be a list",
        ),
        (f"S = [ {ROW}", "S = [ 1.0", 2, "[geometry], number 1 is 1.0, but must be a list of 3 items"),
        (B, "B = 'far away'", 3, 'is the text "far away", but must be a list of 6 items'),
        (L, "l = [1.0, 2.0]", 4, "is a list of 2 items, but must be a list of 6 items"),
        ("l = [ 1.0, 1.0", "l = [ 1.0, '1.0'", 4, 'number 2 is the text "1.0", but must be a number'),
        ("l = [ 1.0, 1.0", "l = [ 1.0,\n true", 5, "number 2 is true, but must be a number"),
        ("B = [ [ 1.0", "B = [ [ nan", 3, "row 1, number 1 is nan, but must be a finite number"),
        ("B = [ [ 1.0", "B = [ [ 1e308", 3, "but must be a number within +-1e+06"),
        ("B = [ [ 1.0", f"B = [ [ 1{'0' * 400}", 3, "but must be a finite number"),
        ("l = [ 1.0, 1.0", "l = [ 1.0, -1.0", 4, "number 2 is -1.0, but must be more than 0"),
        ("l = [ 1.0, 1.0, 1.0", "l = [ 1.0, 1.0, 0", 4, "number 3 is 0, but must be more than 0"),
        (BRANCH, "branch = [1, 1, 1]", 5, "is a list of 3 items, but must be a list of 6 items"),
        ("+1, -1", "\n0, -1", 6, "'branch' in [geometry], number 3 is 0, but must be 1 or -1"),
        ("+1, -1", "true, -1", 5, "number 3 is true, but must be a number"),
        (L, "l = [1.0", 5, "not valid TOML"),
    ],
)
def test_every_mistake_is_named_with_file_and_line(tmp_path, old, new, line, words) -> None:
    assert old in GOOD
    path = tmp_path / "controller.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(FileError) as caught:
        FORMAT.read(path)
    assert words in str(caught.value)
    assert caught.value.subject == str(path)
    if line is not None:
        assert caught.value.line == line


def test_a_leg_too_short_for_six_decimals_is_refused(geometry: Geometry) -> None:
    vector = geometry.vector.copy()
    vector[36] = 1e-9
    with pytest.raises(FileError, match="more than 0"):
        FORMAT.rewrite([GOOD], Geometry(HEXAGLIDE_PARAMETERS, vector))


def test_a_geometry_that_does_not_read_back_is_never_written(config, geometry, monkeypatch) -> None:
    replaced = TomlDocument.replaced
    monkeypatch.setattr(TomlDocument, "replaced", lambda *args: replaced(*args).replace("700.", "70."))
    with pytest.raises(FileError, match="reads back with another l1"):
        FORMAT.rewrite([config.read_text()], geometry)


RANGES = "".join(f"[[axes]]\nmin = {-100.0 * (1 + leg)}\nmax = {50.0}\n" for leg in range(6))


def test_joint_ranges_are_read_where_all_six_axes_state_them(config: Path) -> None:
    text = config.read_text()
    assert FORMAT.read(config).limits.joints is None
    config.write_text(text + RANGES)
    assert FORMAT.read(config).limits.joints == tuple((-100.0 * (1 + leg), 50.0) for leg in range(6))
    config.write_text(text + RANGES.replace("max = 50.0\n", "", 1))
    assert FORMAT.read(config).limits.joints is None
    config.write_text(text + RANGES.removeprefix(RANGES[: RANGES.index("[[axes]]", 1)]))
    assert FORMAT.read(config).limits.joints is None


@pytest.mark.parametrize(("max_", "problem"), [("-100.0", "is not above its min"), ("'x'", "a number")])
def test_joint_ranges_that_are_none_are_refused_with_the_line(config, max_, problem) -> None:
    text = config.read_text()
    config.write_text(text + RANGES.replace("max = 50.0", f"max = {max_}", 1))
    with pytest.raises(FileError, match=problem) as raised:
        FORMAT.read(config)
    assert raised.value.line == len(text.splitlines()) + 3
