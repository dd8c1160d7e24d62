"""TOML texts: mistakes with their line, every value found, and numbers alone changed."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from hexacell.errors import FileError
from hexacell.storage.toml_document import KeyPath, TomlDocument, locate
from tests.hexacell.storage.toml_texts import leaves


def test_a_missing_place_has_the_line_around_it_and_a_byte_order_mark_is_no_text() -> None:
    document = TomlDocument.parse("a = 1\n[b]\nc = 2\n")
    assert document.line_of(("b", "missing", 3)) == 2
    assert document.line_of(("missing",)) is None
    assert TomlDocument.parse("\ufeffa = 1").spans == {("a",): slice(5, 6)}


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a = 1\nb =\n", 2),
        ("a = [1,\n2,\n", 2),
        ("a = [1,\n2", 2),
        ("a = 1\r\na = 2\r\n", 2),
        ("[a]\n[a]", 2),
    ],
)
def test_a_syntax_error_has_its_line(text: str, line: int) -> None:
    with pytest.raises(FileError, match="not valid TOML") as caught:
        TomlDocument.parse(text, Path("cell.toml"))
    assert caught.value.line == line
    assert caught.value.subject == "cell.toml"


def test_endless_brackets_and_numbers_are_refused() -> None:
    with pytest.raises(FileError, match="nested too deeply"):
        TomlDocument.parse("a = " + "[" * 100_000)
    with pytest.raises(FileError, match="too many digits"):
        TomlDocument.parse("a = " + "9" * 5000)
    with pytest.raises(FileError, match="too many digits"):
        TomlDocument.parse("a = 0x" + "f" * 5000).to_json()


TEXT = """\
name = "robot"
[robot.nominal]
S = [[1.0, true], [2020-02-02, []]]
[[gauges]]
[[gauges]]
serial = {a = 1e400}
"""


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        (("name",), "'name' at the top of the file is the text \"robot\", but must be x"),
        (("robot", "nominal"), "'nominal' in [robot] is a section, but must be x"),
        (("robot", "nominal", "S"), "'S' in [robot.nominal] is a list of 2 items, but must be x"),
        (("robot", "nominal", "S", 0), "'S' in [robot.nominal], row 1 is a list of 2 items, but must be x"),
        (("robot", "nominal", "S", 0, 1), "'S' in [robot.nominal], row 1, number 2 is true, but must be x"),
        (
            ("robot", "nominal", "S", 1, 0),
            "'S' in [robot.nominal], row 2, number 1 is a date or a time, but must be x",
        ),
        (("gauges", 1, "serial"), "'serial' in [[gauges]] number 2 is a section, but must be x"),
        (("gauges", 1, "serial", "a"), "'a' in [gauges.serial] number 2 is inf, but must be x"),
    ],
)
def test_places_and_values_in_plain_words(path: tuple[str | int, ...], problem: str) -> None:
    assert TomlDocument.parse(TEXT).mismatch(path, "x") == problem


def test_long_texts_are_quoted_in_part() -> None:
    document = TomlDocument.parse(f"a = '{'b' * 1000}'")
    assert f'the text "{"b" * 40}...", but' in document.mismatch(("a",), "x")


LAYOUTS = {
    "table": "[g]\na = [1, 2] # 1, 2\nb = 3\n",
    "CRLF": "[g]\r\na = [1,\r\n 2]\r\n\r\nb = 3\r\n",
    "mixed line ends": "[g]\r\na = [1,\n 2]\nb = 3\r\n",
    "byte order mark": "\ufeff[g]\na = [1, 2]\nb = 3\n",
    "no final newline": "[g]\na = [1, 2]\nb = 3",
    "blanks at the end": "[g]\na = [1, 2]\nb = 3 \t",
    "inline table": "g = { a = [1 , 2], b=3 } # 1, 2, 3\n",
    "inline table, arrays over lines": "g = {a=[\n1,\n 2 # 2\n,], b = 3}\n",
    "dotted keys": "g.a = [1, 2]\ng . b=3\n",
    "dotted keys with others between": "g.a = [1, 2]\nx = 1\ng.b = 3\ny = 2\n",
    "quoted keys": '["g"]\n\'a\' = [1, 2]\n"b" = 3\n',
    "comments in lists": "[g]\na = [ # 1, 2]\n 1 # 1\n , # 2\n # 2\n 2, # 3\n # 4\n]\nb = 3\n",
    "odd blanks": "\n\t [ g ]\t\n\ta\t= [\t1\t,2  ]  \n  b=3\n\n\n",
    "no blanks": "[g]\na=[1,2]\nb=3",
    "spellings": "[g]\na = [0x1F, 1_000.5e-0_1]\nb = +7E+2\nx = [0b1_1, 0o17, -0.0, 1_0, nan, -inf]\n",
    "not ASCII": "# Längen in µm\n'µ' = \"\\u00e4ä😀\"\n[g]\na = [1, 2] # é\nb = 3\n",
    "table in pieces": "[g]\na = [1, 2]\n[x]\ny = 1\n[g.z]\nb = 3\n[x.w]\n[g.v]\nu = 1\n",
    "arrays of tables": "[[t]]\nn = 1\n[[t]]\nn = 2\n[t.s]\nm = [1]\n[g]\na = [1, 2]\nb = 3\n",
    "tables of an array apart": "[[t]]\nn = 1\n[g]\na = [1, 2]\n[[t]]\nn = 2\n",
    "date in a list": "[g]\na = [1, 2]\nd = [ 1979-05-27 07:32:00 ]\n",
    "deep list": f"[g]\na = 1\nd = {'[' * 101}2{']' * 101}",
    "strings": "s = '''\n[g]\na = [1, 2]\n'''\nt = \"\"\"\nb = 3\\\n \"\"\"\n[g]\na = [1, 2]\nb = 3\n",
}


def replaced(text: str, tokens: Mapping[KeyPath, str]) -> str:
    return TomlDocument.parse(text).replaced(tokens)


def numbers(text: str) -> dict[KeyPath, int | float]:
    """Every number in the text."""
    found = leaves(tomllib.loads(text.removeprefix("\ufeff")))
    return {
        path: value
        for path, value in found.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


@pytest.mark.parametrize("text", LAYOUTS.values(), ids=LAYOUTS)
def test_every_number_alone_can_be_replaced_and_restored(text: str) -> None:
    assert replaced(text, {}) == text
    for path in numbers(text):
        changed = replaced(text, {path: "4711.5"})
        before, _, after = changed.partition("4711.5")
        assert text.startswith(before)
        assert text.endswith(after)
        old = text.removeprefix(before).removesuffix(after)
        assert repr(tomllib.loads(f"x = {old}")["x"]) == repr(numbers(text)[path])
        assert replaced(changed, {path: old}) == text


TRICKY = r'''
# a comment with [brackets] and "quotes
bare-key_1 = 1
"quoted key" = 2
'literal "key"' = 3
"es\"caped = [\u0041]" . inner . 'x' = 4
fruit . apple = 1.5e-3   # trailing comment
date = 1979-05-27 07:32:00
time = 07:32:00
moment=1979-05-27T00:32:00.999999-07:00
basic = "a \" b # c ] } , \\"
literal = 'C:\temp\'
empty = ""
empty_literal = ''
many = """
line [geometry]
S = [1, 2] \"""
ends with quotes: """""
raw = """a\
   b"""
lits = @@@
''two'' \''@@@
five = """"""
arrays = [ # opening
  [1, 2 ,3,], # one
  [ "a,b]", 'c}' , """d
]""" ],
  [], { x = [1 , {y=2}], "z" . w = true },
]   # closing
inline = {}
hex = 0xDEAD_beef
signed = -inf
nothing = +nan
[table]
a = 1
[ table . "sub.table" ]
a=2
[[rows]]
a = 3
[rows.child]
b = 4
[[rows.items]]
c = 5
[[rows.items]]
c = 6
[[rows]]
[[rows.items]]
c = 7
[rows.child.deeper]
d . e = 8
'''.replace("@@@", "'" * 3)


def lines_of(text: str) -> dict[KeyPath, int]:
    return {path: text[: span.start].count("\n") + 1 for path, span in locate(text).items()}


def check(text: str) -> None:
    """Every place is found, and none besides; the text of a value begins on its line."""
    expected = leaves(tomllib.loads(text))
    lines = lines_of(text)
    assert set(lines) == set(expected)
    for path, value in expected.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            assert spelling_on(text.split("\n")[lines[path] - 1], value), path


def spelling_on(line: str, value: float) -> bool:
    """Whether the line has a token that means ``value``."""
    tokens = re.findall(r"[-+\w.]+", line)
    return any(repr(number(token)) == repr(value) for token in tokens)


def number(token: str) -> object:
    try:
        return tomllib.loads(f"x = {token}")["x"]
    except tomllib.TOMLDecodeError:
        return None


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("end", ["", "# no line end after this", "last = 1 "])
def test_every_value_is_found_on_its_line(newline: str, end: str) -> None:
    check((TRICKY + end).replace("\n", newline))


def test_every_kind_of_place() -> None:
    text = "top = 1\n[a]\nb.c = [[1,\n2], { d = '''\n''', e = 3 }]\n[[list]]\n[[list]]\n[list.sub]\nk = 1\n"
    assert lines_of(text) == {
        ("top",): 1,
        ("a",): 2,
        ("a", "b"): 3,
        ("a", "b", "c"): 3,
        ("a", "b", "c", 0): 3,
        ("a", "b", "c", 0, 0): 3,
        ("a", "b", "c", 0, 1): 4,
        ("a", "b", "c", 1): 4,
        ("a", "b", "c", 1, "d"): 4,
        ("a", "b", "c", 1, "e"): 5,
        ("list",): 6,
        ("list", 0): 6,
        ("list", 1): 7,
        ("list", 1, "sub"): 8,
        ("list", 1, "sub", "k"): 9,
    }


def test_a_table_is_where_it_is_mentioned_first() -> None:
    lines = lines_of("x = 1\n\n[a.b]\nc.d = 1\n[a]\n")
    assert lines["a",] == 3
    assert lines["a", "b"] == 3
    assert lines["a", "b", "c"] == 4


keys = st.one_of(
    st.from_regex(r"[A-Za-z0-9_-]{1,4}", fullmatch=True), st.text("a.\"' =[]#\\\té", min_size=1)
)
scalars = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.text("a.\"' =[]{},#\\\n\té", max_size=8),
    st.datetimes(),
    st.dates(),
)
values = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(keys, inner, max_size=3)),
    max_leaves=8,
)


@given(st.dictionaries(keys, values, max_size=4))
def test_every_document_that_a_writer_makes_is_understood(data: dict[str, Any]) -> None:
    text = tomlkit.dumps(data)
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return  # a writer's own mistake
    check(text)
