"""Parts of the reference that are made from the program: no command, key, message or field is missing."""

from pathlib import Path

from docs import generated
from docs.raised_messages import raised_messages
from hexacell.cell.devices import GaugeAxis
from hexacell.cell.loader import schema
from hexacell.cli.arguments import make_parser

DOCS = Path(__file__).parents[3] / "docs"


def test_every_command_has_its_section():
    made = generated.commands()
    [names] = [action.choices for action in make_parser()._actions if isinstance(action.choices, dict)]
    assert [name for name in names if f"## `hexacell {name}`\n" not in made] == []
    assert "| `--resume [RUN]` |" in made


def test_every_key_of_the_cell_file_is_there():
    made = generated.cell_keys()
    definitions = schema()["$defs"].values()
    missing = [
        key
        for section in definitions
        for key in section.get("properties", ())
        if f"`{key}`" not in made and f"{key}]" not in made
    ]
    assert missing == []
    assert "## `[[gauges]]`" in made
    assert "| `sign` | `1` or `-1` | `1` |" in made


def test_every_message_says_what_to_do():
    made = generated.messages((DOCS / "messages.md").read_text(encoding="utf-8"))
    assert [line for line in made.splitlines() if line.endswith("|  |")] == []
    assert len(raised_messages()) > 400
    assert "| the three gauges must measure x, y and z, one each | Correct their axis |" in made


def test_each_page_gets_its_part():
    for page in ("commands.md", "cell-file.md", "messages.md", "journal.md", "device-faults.md"):
        text = (DOCS / page).read_text(encoding="utf-8")
        assert len(generated.page_with_generated_parts(text)) > len(text) + 8000


def test_the_drawing_has_the_signs_of_gauges():
    picture = (DOCS / "gauges.svg").read_text(encoding="utf-8")
    for side, word in ((1, "pushed in"), (-1, "let out")):
        shown = f"is {word}, shows {GaugeAxis(0, side).reading(1.0):+.3f}:"
        assert shown in picture
