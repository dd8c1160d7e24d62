"""Values are found on the lines where they stand."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from itertools import count

from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.diagnostics import line_of, locate

DECOYS = ["", "# [x] = {", "  # '''", '# """', "\t"]
TEXTS = ["'[a]'", '"}#\\""', "'''\n]\n[[b]]\n'''", '"""\n k = 1 \\"""\n"""', "''", '""']
KEYS = ["a", "b-1", "3", '"c d"', "'e.f'", '"[g]"', '"\\u00e4"', '"="']
FIRST_MARK = 1_000_001


class _Writer:
    """Writes a random TOML document in which every integer occurs once."""

    def __init__(self, draw: st.DrawFn) -> None:
        self._draw = draw
        self._marks = count(FIRST_MARK)

    def document(self) -> str:
        tables = (self._table(f"t{n}") for n in range(self._draw(st.integers(0, 3))))
        return self._pairs() + "".join(tables)

    def _table(self, name: str) -> str:
        """A table, or an array of some, each with a table in it."""
        array = self._draw(st.booleans())
        header, times = (f"[[{name}]]", self._draw(st.integers(1, 3))) if array else (f"[ {name} ]", 1)
        headers = (header, f"[{name} . sub]")
        return "".join(f"{text}{self._end()}{self._pairs()}" for _ in range(times) for text in headers)

    def _pairs(self) -> str:
        keys = self._draw(st.lists(st.sampled_from(KEYS), unique=True, max_size=3))
        return "".join(f"{self._key(key)} = {self._value(2)}{self._end()}" for key in keys)

    def _key(self, key: str) -> str:
        return self._draw(st.sampled_from([key, f"{key}.x", f"{key} . 'y z'"]))

    def _value(self, depth: int) -> str:
        kind = self._draw(
            st.sampled_from(["mark", "text", "date", "float"] + ["array", "table"] * (depth > 0))
        )
        if kind == "array":
            items = (
                self._gap() + self._value(depth - 1) + self._gap()
                for _ in range(self._draw(st.integers(0, 3)))
            )
            return f"[{','.join(items)}{self._gap()}]"
        if kind == "table":
            keys = self._draw(st.lists(st.sampled_from(KEYS), unique=True, max_size=2))
            return "{" + ", ".join(f"{self._key(key)} = {self._value(depth - 1)}" for key in keys) + "}"
        if kind == "text":
            return self._draw(st.sampled_from(TEXTS))
        return {"mark": str(next(self._marks)), "date": "1979-05-27 07:32:00", "float": "-1.5e3"}[kind]

    def _gap(self) -> str:
        return self._draw(st.sampled_from(["", " ", "\n", "\r\n", "# ], [\n", "\n\n  "]))

    def _end(self) -> str:
        return self._draw(st.sampled_from([" ", ""])) + self._draw(st.sampled_from(DECOYS)) + "\n"


@st.composite
def documents(draw: st.DrawFn) -> str:
    return _Writer(draw).document()


def _places(path: tuple[str | int, ...], value: object) -> Iterator[tuple[tuple[str | int, ...], object]]:
    if path:
        yield path, value
    inner = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    for key, item in inner:
        yield from _places((*path, key), item)


@given(text=documents())
def test_every_place_is_found_and_nothing_else(text):
    assert set(locate(text)) == {path for path, _ in _places((), tomllib.loads(text))}


@given(text=documents())
def test_numbers_are_found_on_their_lines(text):
    lines = locate(text)
    for path, value in _places((), tomllib.loads(text)):
        if isinstance(value, int) and value >= FIRST_MARK:
            assert lines[path] == text[: text.index(str(value))].count("\n") + 1


def test_every_kind_of_place():
    text = "top = 1\n[a]\nb.c = [[1,\n2], { d = '''\n''', e = 3 }]\n[[list]]\n[[list]]\n[list.sub]\nk = 1\n"
    expected = {
        ("top",): 1,
        ("a",): 2,
        ("a", "b", "c"): 3,
        ("a", "b", "c", 0, 1): 4,
        ("a", "b", "c", 1, "e"): 5,
        ("list", 0): 6,
        ("list", 1): 7,
        ("list", 1, "sub", "k"): 9,
    }
    assert {path: locate(text)[path] for path in expected} == expected


def test_what_is_not_there_is_looked_for_around_it():
    lines = locate("a = 1\n[b]\nc = 2\n")
    assert line_of(lines, ("b", "missing", 3)) == 2
    assert line_of(lines, ("missing",)) is None
