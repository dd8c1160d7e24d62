"""Errors name file and line; only the tokens asked for are replaced."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.errors import FileError
from hexacell.storage.toml_document import TomlDocument
from hexacell.storage.toml_locations import KeyPath
from tests.hexacell.storage.toml_texts import FIRST_MARK, documents, leaves


def test_a_missing_place_has_the_line_of_the_table_around_it() -> None:
    document = TomlDocument.parse("a = 1\n[b]\nc = 2\n")
    assert document.line_of(("b", "missing", 3)) == 2
    assert document.line_of(("missing",)) is None


def test_a_byte_order_mark_is_no_part_of_the_text() -> None:
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


def replaced(text: str, tokens: dict[KeyPath, str]) -> str:
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
def test_every_number_alone_can_be_replaced_and_put_back(text: str) -> None:
    assert replaced(text, {}) == text
    for path in numbers(text):
        changed = replaced(text, {path: "4711.5"})
        before, _, after = changed.partition("4711.5")
        assert text.startswith(before)
        assert text.endswith(after)
        old = text.removeprefix(before).removesuffix(after)
        assert repr(tomllib.loads(f"x = {old}")["x"]) == repr(numbers(text)[path])
        assert replaced(changed, {path: old}) == text


@given(documents(), st.sampled_from(["\n", "\r\n"]), st.sampled_from(["", "\ufeff"]), st.data())
def test_only_the_tokens_asked_for_change(text: str, newline: str, mark: str, data: st.DataObject) -> None:
    text = mark + text.replace("\r\n", "\n").replace("\n", newline)
    places = [
        path for path, value in numbers(text).items() if isinstance(value, int) and value >= FIRST_MARK
    ]
    chosen = data.draw(st.lists(st.sampled_from(places), unique=True) if places else st.just([]))
    tokens = {path: f"{n}.25e3" for n, path in enumerate(chosen)}
    expected = text
    for path, token in tokens.items():
        expected = expected.replace(str(numbers(text)[path]), token)
    assert replaced(text, tokens) == expected
