"""One command on mutated input, in this process, and what it may not do."""

import contextlib
import io
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

from hexacell.cli.app import main
from tests.mutations.texts import raw_signs

CODES = frozenset({0, 1, 2, 3, 4, 5, 6, 130})
"""The documented exit codes, without that of a fault of the program."""

OURS = ("cell/*/index.sqlite*", "cell/*report.*")
"""What any command may make again, as patterns."""


@dataclass(frozen=True)
class Place:
    """A folder with a cell in it, beside which there are things that no command may change."""

    root: Path
    as_process: bool = False

    @property
    def cell(self) -> Path:
        """The folder of the cell."""
        return self.root / "cell"

    @property
    def temporary(self) -> Path:
        """Where temporary files are made, of which none may stay."""
        return self.root / "temporary"

    def refill(self, template: Path, made_in: Path) -> None:
        """Make the cell's folder a copy of another one, whose runs were made in a folder."""
        shutil.rmtree(self.root, ignore_errors=True)
        (self.root / "outside").mkdir(parents=True)
        (self.root / "outside" / "canary").write_text("nobody may change this")
        self.temporary.mkdir()
        shutil.copytree(template, self.cell, symlinks=True)
        for path in self.cell.rglob("*.json"):
            path.write_text(path.read_text().replace(str(made_in), str(self.cell)))


@dataclass(frozen=True)
class Attempt:
    """A command, how it ended, and what is wrong with that."""

    arguments: tuple[str, ...]
    code: int
    out: str
    err: str
    seconds: float
    problems: tuple[str, ...] = field(default=())

    def __str__(self) -> str:
        return f"{' '.join(self.arguments)}: {'; '.join(self.problems)}\n{self.err[-2000:]}"


def contents(folder: Path) -> dict[Path, bytes | None]:
    """Everything below a folder: files, where links lead to, and None for what is neither."""
    found: dict[Path, bytes | None] = {}
    for path in folder.iterdir():
        is_link = path.is_symlink()
        found[path] = (
            os.fsencode(path.readlink()) if is_link else path.read_bytes() if path.is_file() else None
        )
        found |= contents(path) if path.is_dir() and not is_link else {}
    return found


def changes(before: dict[Path, bytes | None], place: Place, may_change: Sequence[str]) -> Iterator[str]:
    """What is not as it was, but for what may change and for new files of the cell beside its runs."""
    after = contents(place.root)
    for path in sorted(before.keys() | after.keys()):
        name = path.relative_to(place.root).as_posix()
        is_new = path not in before and path.parent / "journal.jsonl" not in before and name[:5] == "cell/"
        is_same = (path in before, before.get(path)) == (path in after, after.get(path))
        if not (is_same or is_new or any(fnmatch(name, one) for one in (*OURS, *may_change))):
            yield f"changed: {name}"


@contextlib.contextmanager
def _temporary_files_in(folder: Path) -> Iterator[None]:
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        yield
    finally:
        tempfile.tempdir = before


def attempt(arguments: Sequence[object], place: Place, may_change: Sequence[str] = ()) -> Attempt:
    """Run a command on the cell of a place, where it may change files of some patterns."""
    typed = tuple(map(str, arguments))
    before = contents(place.root)
    began = _cpu_seconds()
    code, out, err, problems = (_in_a_process if place.as_process else _in_this_process)(typed, place)
    seconds = _cpu_seconds() - began
    problems += _wrong_end(code, out, err, is_json="--json" in typed)
    for left in place.temporary.iterdir():
        problems.append(f"left behind: {left.name}: {left.read_text() if left.is_file() else 'a folder'}")
        left.unlink() if left.is_file() else shutil.rmtree(left)
    problems += changes(before, place, may_change)
    return Attempt(typed, code, out, err, seconds, tuple(problems))


def _cpu_seconds() -> float:
    """Of this process and of those that it waited for: how busy the computer is else does not count."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


Ended = tuple[int, str, str, list[str]]
"""Exit code, output, errors, and warnings."""


def _in_a_process(typed: tuple[str, ...], place: Place) -> Ended:
    ended = subprocess.run(
        [sys.executable, "-m", "hexacell", *typed],
        env={**os.environ, "TMPDIR": str(place.temporary)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    warned = [f"warning: {line}" for line in ended.stderr.splitlines() if "Warning:" in line]
    return ended.returncode, ended.stdout, ended.stderr, warned


def _in_this_process(typed: tuple[str, ...], place: Place) -> Ended:
    out, err = io.StringIO(), io.StringIO()
    with (
        warnings.catch_warnings(record=True) as caught,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        _temporary_files_in(place.temporary),
    ):
        warnings.simplefilter("always")
        code = main(list(typed))
    warned = [f"{one.category.__name__}: {one.message} ({one.filename}:{one.lineno})" for one in caught]
    return code, out.getvalue(), err.getvalue(), warned


def _wrong_end(code: int, out: str, err: str, *, is_json: bool) -> Iterator[str]:
    if code not in CODES:
        yield f"exit code {code}"
    if "Traceback" in out + err:
        yield "a traceback"
    if code and not err.strip() and not out.strip():
        yield "nothing was said"
    if signs := raw_signs(out + err):
        yield f"raw: {signs}"
    if is_json:
        try:
            json.loads(out)
        except ValueError:
            yield "no JSON document"
