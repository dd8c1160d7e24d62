"""The commands of tutorial and how-tos, typed as written, end as these say and print what they show."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.pages import FENCE, ROOT, UNFINISHED, Block, blocks_of, check, commands_of, missing
from tests.hexacell.services.notify.local_servers import webhook

TUTORIAL = blocks_of(ROOT / "docs/tutorial.md")
HOWTOS = {
    page.name: FENCE.sub("", page.read_text(encoding="utf-8"))
    for page in sorted((ROOT / "docs").glob("howto-*.md"))
}
"""Without the blocks that a page has typed as they are."""

ONLY_PARSED = {
    "devices": "asks what is attached to this computer; --diagnose is typed",
    "schedule": "installs units of systemd",
    "serve": "goes on until it is interrupted",
    "tui": "needs a terminal",
    "status --archive": "needs a server of PostgreSQL",
    "history --archive": "needs a server of PostgreSQL",
    "run my-robot.toml --resume": "needs a run that was interrupted",
}
"""Why commands of the how-tos are not typed here; they have tests of their own."""

BEFORE = {
    "next my-robot.toml --measurements records.csv": ": >records.csv",
    "fit my-robot.toml --measurements records.csv": "cp RUN/measurements.csv records.csv",
}
"""What a page tells to do before a command."""


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """The folder of the source, as far as the tutorial uses it."""
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    return tmp_path


def test_it_begins_as_written(source):
    begin, of_cell, *_ = TUTORIAL
    assert begin.commands == ("hexacell --version",)
    assert of_cell.shown
    check([begin, of_cell], source)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", ["tutorial.md", "howto-mock-cell.md", "howto-repeatability.md"])
def test_every_command_works_as_written(source, page):
    check(blocks_of(ROOT / "docs" / page), source)


def is_only_parsed(command: str) -> bool:
    return "--diagnose" not in command and any(map(command.startswith, ONLY_PARSED))


def typed_commands(page: str) -> list[str]:
    """What is typed of a page: whole commands, each with what comes before it."""
    whole = (command for _, command in commands_of(HOWTOS[page]) if " " in command)
    commands = [one for one in whole if not UNFINISHED.search(one) and not is_only_parsed(one)]
    return [line for one in commands for line in (*filter(None, [BEFORE.get(one)]), f"hexacell {one}")]


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a simulated my-robot.toml that was calibrated, tells somebody, names a laboratory."""
    folder = tmp_path_factory.mktemp("my-robot") / "cell"
    for path in (".local/share/bash-completion/completions", ".config/fish/completions", ".zfunc"):
        (folder / path).mkdir(parents=True)
    text = (ROOT / "configs/simulated-hexaglide.toml").read_text()
    text = text.replace('"simulated-hexaglide"', '"my-robot"')
    stated = ("serial_number", "laboratory", "customer", "authorised_by")
    report = "".join(f'{key} = "A"\n' for key in stated)
    shutil.copy(ROOT / "configs/simulated-hexaglide.controller.toml", folder)
    with webhook() as hook:
        (folder / "my-robot.toml").write_text(
            f'{text}\n[report]\n{report}country = "DE"\n'
            f'\n[[notifications]]\nname = "night shift"\nurl = "{hook.url}"\n'
        )
        check([Block(("hexacell run my-robot.toml --unattended --mode optimise",), False)], folder)
        shutil.copytree(folder, folder / "cells")
        yield shutil.copytree(folder, folder.with_name("calibrated"))


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", [page for page in HOWTOS if typed_commands(page)])
def test_every_command_of_a_how_to_ends_well(calibrated, page):
    folder = calibrated.with_name("cell")  # the same for each page: a proposal is applied where it was made
    shutil.rmtree(folder)
    shutil.copytree(calibrated, folder)
    [run] = (folder / "runs/my-robot").glob("*Z")
    named = re.compile(r"(runs/my-robot/)?(20\d\d-\d\d-\d\dT\d+Z)|\bRUN\b")
    commands = tuple(named.sub(f"runs/my-robot/{run.name}", one) for one in typed_commands(page))
    check([Block((command,), False) for command in commands], folder)


def test_no_command_is_left_out_that_no_page_has():
    every = [command for text in HOWTOS.values() for _, command in commands_of(text)]
    assert [left for left in ONLY_PARSED if not any(one.startswith(left) for one in every)] == []


def test_a_line_that_is_not_printed_is_missed():
    assert missing(("point 1   11 records", "verdict: ..."), "point 2   7 records\nverdict: pass\n") == []
    assert missing(("verdict: pass",), "verdict: fail\n") == ["verdict: pass"]
    assert missing(("second", "first"), "first\nsecond\n") == ["first"]
