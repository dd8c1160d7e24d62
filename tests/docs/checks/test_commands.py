"""Every command that a page shows is one that the program takes."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from hexacell.cli.arguments import make_parser
from hexacell.errors import UsageError

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
TYPED = re.compile(r"^ *(?:[A-Z_]+=\S+ )*(?:\.venv/bin/|/\S+/bin/)?hexacell (.+)$")
IN_TEXT = re.compile(r"`hexacell ([^`]+)`")
UNFINISHED = re.compile(r"\.\.\.|\||\[")
"""Of a description of commands, which nobody can type as it is."""


def commands_of(page: Path) -> Iterator[tuple[int, str]]:
    """The commands of a page, with their lines."""
    is_fenced = False
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        is_fenced ^= line.startswith("```")
        if (is_fenced or line.startswith("    ")) and (typed := TYPED.match(line)):
            yield number, typed[1]
        for told in IN_TEXT.findall(line):
            yield number, told


def words_of(command: str) -> list[str]:
    """Its words, without what the shell does with it."""
    words = shlex.split(command, comments=True)
    ends = [place for place, word in enumerate(words) if word[0] in "&|>" or word.startswith("</")]
    return words[: ends[0]] if ends else words


def test_the_program_takes_every_command_of_the_pages():
    commands = [
        (page.name, number, command)
        for page in PAGES
        for number, command in commands_of(page)
        if not UNFINISHED.search(command)
    ]
    assert len(commands) > 100
    assert [(*one, why) for one in commands if (why := refusal(one[-1]))] == []


def refusal(command: str) -> str | None:
    """Why the program does not take it; in text a command may be named without all that it needs."""
    try:
        make_parser().parse_args(words_of(command))
    except UsageError as error:
        return None if "arguments are required" in str(error) else str(error)
    except SystemExit as told:
        return None if told.code == 0 else "it ends at once"
    return None


def test_a_wrong_option_is_noticed():
    assert "unrecognized arguments: --unatended" in str(refusal("run cell.toml --unatended"))
