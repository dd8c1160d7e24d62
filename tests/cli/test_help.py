"""What a newcomer types first: nothing, a wrong command, ``--help``."""

import subprocess
import sys
from pathlib import Path

import pytest

from hexacell.cli.app import main
from hexacell.cli.arguments import make_parser
from tests.cli.test_completion import commands_of

SLOW_TO_IMPORT = {"numpy", "scipy", "textual", "matplotlib", "pydantic", "rich", "asyncio"}
UNNEEDED_AT_START = {"sqlalchemy", "matplotlib", "textual", "scipy"}
PAGES = [path for path, _ in commands_of(make_parser())]
COMMANDS = [path[0] for path in PAGES if len(path) == 1]


def imported(folder: Path, *arguments: str) -> set[str]:
    ended = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "hexacell", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    return {line.rpartition("|")[2].strip().partition(".")[0] for line in ended.stderr.splitlines()}


@pytest.mark.parametrize("arguments", [["run", "--help"], ["completion", "bash"], []])
def test_help_imports_nothing_slow(tmp_path, arguments):
    modules = imported(tmp_path, *arguments)
    assert "hexacell" in modules
    assert modules.isdisjoint(SLOW_TO_IMPORT)


def test_a_run_begins_without_what_it_does_not_need():
    code = f"import sys, hexacell.cli.commands.run; print(*{UNNEEDED_AT_START!r} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_every_page_fits_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for page in PAGES:
        with pytest.raises(SystemExit) as left:
            main([*page, "--help"])
        out, err = capsys.readouterr()
        assert (left.value.code, err) == (0, "")
        assert out.startswith(f"usage: {' '.join(['hexacell', *page])} ")
        assert max(map(len, out.splitlines())) <= 80


def test_help_names_every_command_in_one_line_each_and_every_exit_code(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main(["--help"])
    lines = capsys.readouterr().out.splitlines()
    begun = lines.index("  COMMAND [...]") + 1
    assert [line.split()[0] for line in lines[begun : begun + len(COMMANDS)]] == COMMANDS
    codes = " ".join(lines[lines.index("exit codes:") :])
    assert all(f" {code} " in codes for code in (0, 1, 2, 3, 4, 5, 6, 7, 70, 130))


def test_no_arguments_are_answered_with_the_help(typed_here, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    outcome = typed_here()
    assert (outcome.code, outcome.out, outcome.err) == (2, "", make_parser().format_help())


def test_a_usage_error_is_one_line_and_with_json_a_document_too(typed_here):
    wrong = {
        ("frobnicate",): "invalid choice: 'frobnicate' (choose from 'demo', 'run'",
        ("run", "--json"): "the following arguments are required: CELL. Try `hexacell run --help`",
        ("cell",): "the following arguments are required: ACTION. Try `hexacell cell --help`",
        ("run", "cell.toml", "--mode", "improve"): "invalid choice: 'improve'",
        ("run", "cell.toml", "--unattend"): "unrecognized arguments: --unattend",
        ("simulate", "cell.toml", "--json"): "unrecognized arguments: --json",
    }
    for arguments, words in wrong.items():
        outcome = typed_here(*arguments)
        assert outcome.code == 2
        assert outcome.err.startswith("hexacell: ")
        assert outcome.err.count("\n") == 1
        assert words in outcome.err
        if arguments == ("run", "--json"):
            assert outcome.document == {"error": words, "exit_code": 2}
