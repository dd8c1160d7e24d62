"""The options of a controller are checked by its driver's own model, and shown with the cell."""

from pathlib import Path

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import checked_cell, describe, schema
from hexacell.errors import FileError

CELL = bundled_config("simulated-hexaglide").read_text()


def with_options(*lines: str, protocol: str = "adapter") -> str:
    """The bundled cell with another controller, whose options are these lines."""
    section = "\n".join(["[controller.options]", *lines, ""]) if lines else ""
    text = CELL.replace('protocol = "linuxcncrsh"', f'protocol = "{protocol}"', 1)
    return text.replace("[[gauges]]", f"{section}\n[[gauges]]", 1)


def test_they_are_those_of_the_driver_and_shown_with_their_defaults() -> None:
    cell = checked_cell(Path("cell.toml"), with_options('command = ["python3", "robot.py"]'))
    shown = describe(cell)
    assert 'command = ["python3", "robot.py"]' in shown
    assert "settings = {}  # default" in shown
    assert checked_cell(Path("cell.toml"), shown).settings == cell.settings
    options = schema()["$defs"]["ControllerSettings"]["properties"]["options"]["anyOf"]
    assert {"$ref": "#/$defs/AdapterOptions"} in options


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (
            ("comand = []",),
            r"cell\.toml:\d+: unknown key 'comand' in \[controller\.options\]\. Did you mean 'command'",
        ),
        (('command = "robot.py"',), r"cell\.toml:\d+: .*must be a list"),
        (('address = "nowhere"',), r"cell\.toml:\d+: .*no address"),
        (('address = "a:1"', 'command = ["b"]'), r"one of command and address"),
        ((), r"\[controller\.options\] is missing"),
    ],
)
def test_mistakes_are_named_with_their_line(lines: tuple[str, ...], words: str) -> None:
    with pytest.raises(FileError, match=words):
        checked_cell(Path("cell.toml"), with_options(*lines))


def test_a_controller_without_options_takes_none() -> None:
    with pytest.raises(FileError, match=r"unknown key 'command' in \[controller\.options\]"):
        checked_cell(Path("cell.toml"), with_options("command = []", protocol="linuxcncrsh"))
