"""What is wrong with a TOML text is reported with file and line."""

from pathlib import Path

import pytest

from hexacell.errors import FileError
from hexacell.storage.toml_document import TomlDocument


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
