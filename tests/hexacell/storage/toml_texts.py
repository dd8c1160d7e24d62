"""Random TOML texts in all kinds of layouts, and the places in them."""

from itertools import count
from typing import Any

from hypothesis import strategies as st

from hexacell.storage.toml_document import KeyPath

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
