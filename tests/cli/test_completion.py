"""Shells complete what is typed: each is asked by the script that the program prints for it."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hexacell.cell.bundled import bundled_names
from hexacell.cli.app import main
from hexacell.cli.parser import make_parser
from tests.cli.terminal import Terminal

SHELLS = ("bash", "zsh", "fish")
BASH = """\
source ./script
COMP_WORDS=(hexacell "$@")
COMP_CWORD=$#
_shtab_hexacell
printf '%s\\n' "${COMPREPLY[@]}"
"""
INTERACTIVE = {
    "bash": ["bash", "--norc", "--noprofile", "-i"],
    "zsh": ["zsh", "-f", "-i"],
}
"""Shells without anybody's settings."""
READY = {
    "bash": "source ./script",
    "zsh": "fpath=($PWD/functions $fpath); autoload -Uz compinit; compinit -u -D",
}
"""How the README has the script installed."""

TYPED = [
    ("hexacell comple", "tion"),
    ("hexacell run my", "-robot.toml"),
    ("hexacell run my-robot.toml --mode opt", "imise"),
    ("hexacell run my-robot.toml --unatt", "ended"),
    ("hexacell fit my-robot.toml --measurements rec", "ords.csv"),
    ("hexacell report runs/my-robot/20", "26-11-20T103000Z"),
    ("hexacell cell val", "idate"),
    ("hexacell demo --config paper", "-experiment"),
]
"""What is typed before the tab key, and what that adds."""


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A folder with a cell, its files, a run and every shell's script."""
    for name in ("my-robot.toml", "my-notes.txt", "records.csv", "records.ods"):
        (tmp_path / name).touch()
    (tmp_path / "runs/my-robot/2026-11-20T103000Z").mkdir(parents=True)
    (tmp_path / "runs/my-robot/20-notes.txt").touch()
    (tmp_path / "functions").mkdir()
    for shell, path in (("bash", "script"), ("zsh", "functions/_hexacell"), ("fish", "script.fish")):
        assert main(["completion", shell]) == 0
        (tmp_path / path).write_text(capsys.readouterr().out)
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


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["run", ""], ["functions", "my-robot.toml", "runs"]),
        (["run", "my-robot.toml", "--mode", ""], ["check", "optimise", "quick"]),
        (["run", "my-robot.toml", "--events", "my"], ["my-notes.txt", "my-robot.toml"]),
        (["history", "my-robot.toml", "--compare", "r"], ["runs"]),
        (["devices", "--diagnose", "x", "--cell", "my"], ["my-robot.toml"]),
        (["demo", "--config", ""], sorted(bundled_names())),
        (["completion", ""], sorted(SHELLS)),
    ],
    ids=" ".join,
)
def test_bash_offers_what_a_value_can_be(folder, words, offered):
    assert asked_of_bash(folder, *words) == offered


@contextmanager
def typing_at(shell: str, folder: Path) -> Iterator[Terminal]:
    """A terminal with a shell that has the script."""
    master, slave = os.openpty()
    environment = {
        "PATH": os.environ["PATH"],
        "HOME": str(folder),
        "TERM": "xterm",
        "PS1": "",
        "LC_ALL": "C",
    }
    running = subprocess.Popen(
        INTERACTIVE[shell],
        cwd=folder,
        env=environment,
        stdin=slave,
        stdout=slave,
        stderr=slave,
        start_new_session=True,
    )
    try:
        yield Terminal(master, slave)
    finally:
        running.kill()
        running.wait()
        os.close(master)
        os.close(slave)


def require(shell: str) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")


@pytest.mark.parametrize("shell", INTERACTIVE)
def test_the_tab_key_completes_what_is_typed(folder, shell):
    require(shell)
    with typing_at(shell, folder) as terminal:
        terminal.type(f"{READY[shell]}; echo is re''ady\n")
        terminal.read_until("is ready")
        for typed, added in TYPED:
            terminal.type(typed)
            terminal.read_until(typed)
            terminal.type("\t")
            terminal.read_until(added)
            terminal.type("\x15")  # Ctrl-U: away with the line


@pytest.mark.parametrize(("typed", "added"), TYPED)
def test_fish_completes_the_same(folder, typed, added):
    require("fish")
    question = f"source script.fish; complete -C '{typed}'"
    asked = ["fish", "--no-config", "--command", question]
    environment = {**os.environ, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    told = subprocess.run(asked, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    offered = [line.partition("\t")[0].rstrip("/") for line in told.stdout.splitlines()]
    assert offered == [typed.rpartition(" ")[2] + added]


def test_a_shell_that_it_does_not_know_is_refused(typed_here: Callable):
    outcome = typed_here("completion", "csh")
    assert outcome.code == 2
    assert "invalid choice: 'csh' (choose from 'bash', 'zsh', 'fish')" in outcome.err


def test_nothing_slow_is_imported_for_it(tmp_path):
    code = (
        "import sys; from hexacell.cli.app import main; main(['completion', 'bash']); print(*sys.modules)"
    )
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    loaded = set(told.stdout.splitlines()[-1].split())
    assert "shtab" in loaded
    assert loaded.isdisjoint({"numpy", "scipy", "pydantic", "textual", "matplotlib", "rich"})
