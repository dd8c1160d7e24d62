"""Every value of a TOML text is found where it stands, whatever stands around it."""

import re
import tomllib
from typing import Any

import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from hexacell.storage.toml_document import KeyPath, locate
from tests.hexacell.storage.toml_texts import leaves

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
