"""Shells complete what is typed: bash is asked by the script that the program prints for it."""

import argparse
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from hexacell.cell.bundled import bundled_names
from hexacell.cli.app import main
from hexacell.cli.arguments import make_parser

SHELLS = ("bash", "zsh", "fish")
BASH = """\
source ./script-bash
COMP_WORDS=(hexacell "$@")
COMP_CWORD=$#
_shtab_hexacell
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A folder with a cell, its files, a run and every shell's script."""
    for name in ("my-robot.toml", "my-notes.txt", "records.csv", "records.ods"):
        (tmp_path / name).touch()
    (tmp_path / "runs/my-robot/2026-11-20T103000Z").mkdir(parents=True)
    (tmp_path / "runs/my-robot/20-notes.txt").touch()
    for shell in SHELLS:
        assert main(["completion", shell]) == 0
        (tmp_path / f"script-{shell}").write_text(capsys.readouterr().out)
    return tmp_path


def asked_of_bash(folder: Path, *words: str) -> list[str]:
    """What bash offers for the last of these words."""
    asked = ["bash", "--norc", "-c", BASH, "-", *words]
    return sorted(
        subprocess.run(asked, cwd=folder, capture_output=True, text=True, check=True).stdout.split()
    )


def commands_of(
    parser: argparse.ArgumentParser, *path: str
) -> Iterator[tuple[tuple[str, ...], argparse.ArgumentParser]]:
    """A parser, and those of all commands below it that the help names."""
    yield path, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for told in action._choices_actions:
                yield from commands_of(action.choices[told.dest], *path, told.dest)


def test_bash_has_every_command_and_every_option_of_the_parser(folder):
    every = dict(commands_of(make_parser()))
    assert len(every) > 25
    for path, parser in every.items():
        below = sorted(longer[-1] for longer in every if longer[:-1] == path and longer)
        if below:
            assert asked_of_bash(folder, *path, "") == below
        options = [option for action in parser._actions for option in action.option_strings]
        assert asked_of_bash(folder, *path, "-") == sorted(options)


def test_bash_offers_what_a_value_can_be(folder):
    offered = {
        ("run", ""): ["my-robot.toml", "runs"],
        ("run", "my-robot.toml", "--mode", ""): ["check", "optimise", "quick"],
        ("run", "my-robot.toml", "--events", "my"): ["my-notes.txt", "my-robot.toml"],
        ("history", "my-robot.toml", "--compare", "r"): ["runs"],
        ("devices", "--diagnose", "x", "--cell", "my"): ["my-robot.toml"],
        ("demo", "--config", ""): sorted(bundled_names()),
        ("completion", ""): sorted(SHELLS),
    }
    assert {words: asked_of_bash(folder, *words) for words in offered} == offered
