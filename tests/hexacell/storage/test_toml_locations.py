import tomllib
from typing import Any

import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from hexacell.storage.toml_locations import KeyPath, line_of, locate

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


def leaves(node: Any, path: KeyPath = ()) -> dict[KeyPath, Any]:
    """Every value in what tomllib read, tables and arrays included, by its path."""
    found = {path: node} if path else {}
    if isinstance(node, dict):
        for key, child in node.items():
            found |= leaves(child, (*path, key))
    if isinstance(node, list):
        for index, child in enumerate(node):
            found |= leaves(child, (*path, index))
    return found


def check(text: str) -> None:
    expected = leaves(tomllib.loads(text.removeprefix("\ufeff")))
    spans = locate(text)
    assert set(spans) == set(expected)
    for path, value in expected.items():
        if not isinstance(value, dict | list):
            token = spans[path].of(text)
            assert repr(tomllib.loads(f"x = {token}")["x"]) == repr(value), path


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["", "# no line end after this", "last = 1 "])
def test_every_value_is_found_where_it_stands(newline: str, mark: str, end: str) -> None:
    check(mark + (TRICKY + end).replace("\n", newline))


def test_arrays_and_inline_tables_have_the_span_of_all_of_them() -> None:
    text = "a = [1, [2, 3] , ] # end\nb = { c = [4] } \n"
    spans = locate(text)
    assert spans["a",].of(text) == "[1, [2, 3] , ]"
    assert spans["a", 1].of(text) == "[2, 3]"
    assert spans["b",].of(text) == "{ c = [4] }"


def test_a_table_is_where_it_is_mentioned_first() -> None:
    text = "x = 1\n\n[a.b]\nc.d = 1\n"
    spans = locate(text)
    assert line_of(text, spans["a",].start) == 3
    assert line_of(text, spans["a", "b"].start) == 3
    assert line_of(text, spans["a", "b", "c"].start) == 4


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
