"""Every command that a page shows is one that the program takes."""

import shlex

from hexacell.cli.arguments import make_parser
from hexacell.errors import UsageError
from tests.docs.pages import ROOT, UNFINISHED, commands_of

PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]


def words_of(command: str) -> list[str]:
    """Its words, without what the shell does with it."""
    words = shlex.split(command, comments=True)
    ends = [place for place, word in enumerate(words) if word[0] in "&|>" or word.startswith("</")]
    return words[: ends[0]] if ends else words


def test_the_program_takes_every_command_of_the_pages():
    commands = [
        (page.name, number, command)
        for page in PAGES
        for number, command in commands_of(page.read_text(encoding="utf-8"))
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
