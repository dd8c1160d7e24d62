"""The commands of the pages, and typing them in a folder."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^```(sh|sh fails|text)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
OMITTED = "..."
MARK = "end of block"
TYPED = re.compile(r"^ *(?:[A-Z_]+=\S+ )*(?:\.venv/bin/|/\S+/bin/)?hexacell (.+)$")
IN_TEXT = re.compile(r"`hexacell ([^`]+)`")
UNFINISHED = re.compile(r"\.\.\.|\||\[")
"""Of a description of commands, which nobody can type as it is."""


@dataclass(frozen=True)
class Block:
    """Some commands, and what the page shows of their output.

    Attributes:
        shown: its passages, in order; between them something is left out.
    """

    commands: tuple[str, ...]
    fails: bool
    shown: tuple[str, ...] = ()


def blocks_of(page: Path) -> list[Block]:
    """The blocks of a page in the order in which they are typed."""
    found: list[Block] = []
    for kind, text in FENCE.findall(page.read_text(encoding="utf-8")):
        if kind == "text":
            passages = re.split(rf"^{re.escape(OMITTED)}$", text, flags=re.MULTILINE)
            shown = tuple(line for passage in passages for line in passage.strip().splitlines())
            found[-1] = replace(found[-1], shown=(*found[-1].shown, *shown))
        else:
            found.append(Block(tuple(text.splitlines()), kind.endswith("fails")))
    return found


def without_figures(text: str) -> str:
    """A text in which all figures and gaps are the same: those shown are of another run."""
    return " ".join(re.sub(r"[0-9][0-9.TZ-]*", "#", text).split())


def typed(blocks: list[Block], folder: Path) -> list[tuple[list[int], str]]:
    """The exit codes of each block's commands and its output, in one shell whose home is the folder."""
    lines = []
    for block in blocks:
        lines += [f"{{ {command}\n}} 2>&1; echo '{MARK}' $?" for command in block.commands]
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    ended = subprocess.run(
        ["bash", "-c", "\n".join(lines)],
        cwd=folder,
        env={**os.environ, "PATH": path, "HOME": str(folder), "COLUMNS": "80"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=True,
    )
    pieces = iter(re.split(rf"^{MARK} (\d+)\n", ended.stdout, flags=re.MULTILINE))
    outcomes = []
    for block in blocks:
        told = [(next(pieces), int(next(pieces))) for _ in block.commands]
        outcomes.append(([code for _, code in told], "".join(text for text, _ in told)))
    return outcomes


def missing(shown: tuple[str, ...], printed: str) -> list[str]:
    """The lines that the page shows, and that were not printed in their order."""
    rest = iter([without_figures(line) for line in printed.splitlines()])
    return [line for line in shown if not any(found.startswith(line_of(line)) for found in rest)]


def line_of(shown: str) -> str:
    """A line without figures, and without what the page leaves out of it."""
    return without_figures(shown).removesuffix(OMITTED).rstrip()


def check(blocks: list[Block], folder: Path) -> None:
    """Type the blocks: all commands end as they say and print what the page shows."""
    for block, (codes, printed) in zip(blocks, typed(blocks, folder), strict=True):
        assert codes == [0] * (len(codes) - 1) + [int(block.fails)], printed
        assert missing(block.shown, printed) == [], printed


def commands_of(text: str) -> Iterator[tuple[int, str]]:
    """The commands of a page, in blocks and in the text, with their lines."""
    is_fenced = False
    for number, line in enumerate(text.splitlines(), start=1):
        is_fenced ^= line.startswith("```")
        if (is_fenced or line.startswith("    ")) and (typed := TYPED.match(line)):
            yield number, typed[1].partition(" #")[0].rstrip()
        for told in IN_TEXT.findall(line):
            yield number, told
