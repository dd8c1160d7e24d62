"""Figures of benchmarks, each with its unit and target: printed, kept in one file, shown as a table.

``python -m tests.benchmarks.figures`` writes the table, see ``make figures``.
"""

import csv
import io
import json
import math
import os
import platform
import subprocess
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from scipy.stats import binom

from tests.benchmarks.samples import samples

CHECKOUT = Path(__file__).parents[2]
FIGURES = CHECKOUT / "build" / "figures.json"
TABLE = CHECKOUT / "docs" / "measured-figures.csv"
DID_NOT_END = "did not run to its end"
MISSED = "missed"


@dataclass(frozen=True)
class Target:
    """What a figure must keep within."""

    least: float = -math.inf
    most: float = math.inf

    def __str__(self) -> str:
        if self.least == self.most:
            return f"{self.most:g}"
        if self.least == -math.inf:
            return f"at most {self.most:.4g}"
        if self.most == math.inf:
            return f"at least {self.least:.4g}"
        return f"{self.least:.4g} to {self.most:.4g}"

    def holds(self, value: float) -> bool:
        """Whether a value keeps within it, which no value that is not a number does."""
        return bool(self.least <= value <= self.most)


def at_most(most: float) -> Target:
    return Target(most=most)


def at_least(least: float) -> Target:
    return Target(least=least)


def between(least: float, most: float) -> Target:
    return Target(least, most)


NEVER = Target(0.0, 0.0)
"""Of what must not happen at all."""

SURELY = 1e-3
"""Probability with which a figure that is exactly on its target is found beyond it by chance."""


def most_by_chance(share: float, count: int) -> int:
    """The largest number out of ``count`` that agrees with a share."""
    return int(binom.isf(SURELY, count, share))


def least_by_chance(share: float, count: int) -> int:
    """The smallest number out of ``count`` that agrees with a share."""
    return int(binom.ppf(SURELY, count, share))


@dataclass(frozen=True)
class Figure:
    """One figure as the file has it; ``met`` is null where there is no target."""

    benchmark: str
    name: str
    value: float | str | None
    unit: str
    target: str
    met: bool | None
    commit: str
    samples: str
    machine: str

    def line(self) -> str:
        """As it is printed while the benchmark runs."""
        target = f"({self.target})" if self.target else ""
        return f"  {self.name:<64} {self.shown:>18}  {target}{'  MISSED' if self.met is False else ''}"

    @property
    def shown(self) -> str:
        value = f"{self.value:.4g}" if isinstance(self.value, float) else str(self.value)
        return f"{'-' if self.value is None else value} {self.unit}".strip()


@dataclass(frozen=True)
class Figures:
    """Where the figures of one benchmark go, and what it has missed so far."""

    benchmark: str
    module: str
    missed: list[str]
    file: Path | None

    def __call__(
        self, name: str, value: float | str | None, unit: str = "", target: Target | None = None
    ) -> None:
        """Print and keep a figure; a missed target fails the benchmark when it has come to its end."""
        met = None
        if target is not None:
            met = isinstance(value, int | float) and target.holds(float(value))
        number = _number(value)
        figure = Figure(
            self.benchmark,
            name,
            number,
            unit,
            "" if target is None else str(target),
            met,
            commit(),
            ", ".join(f"{key}={size}" for key, size in samples(self.module).items()),
            machine(),
        )
        print(f"\n{figure.line()}", end="", flush=True)
        if met is False:
            self.missed.append(f"{name}: {figure.shown} ({target})")
        if self.file is not None:
            keep(figure, self.file)


def _number(value: float | str | None) -> float | str | None:
    """A value that JSON has, without numpy's types."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, int) or float(value).is_integer():
        return int(value)
    return float(value) if math.isfinite(value) else str(float(value))


def keep(figure: Figure, file: Path) -> None:
    """Put a figure into the file, in the place of the one of the same name, if there is one."""
    kept = {(one.benchmark, one.name): one for one in read(file)}
    kept[figure.benchmark, figure.name] = figure
    kept = {
        key: one for key, one in kept.items() if one.commit == figure.commit or not _is_end(one, figure)
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    document = {"commit": figure.commit, "figures": [asdict(one) for one in kept.values()]}
    new = file.with_suffix(".new")
    new.write_text(json.dumps(document, indent=1))
    new.replace(file)


def _is_end(old: Figure, new: Figure) -> bool:
    """Whether an old figure says that a benchmark did not end, which has since given another figure."""
    return old.benchmark == new.benchmark and old.name == DID_NOT_END


def read(file: Path) -> list[Figure]:
    """The figures in the file; none if there is no file."""
    return [Figure(**one) for one in json.loads(file.read_text())["figures"]] if file.exists() else []


@cache
def commit() -> str:
    """The present commit, with a + if files differ from it."""

    def git(*words: str) -> str:
        command = ["git", "-C", str(CHECKOUT), *words]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no")
    return (git("rev-parse", "--short=8", "HEAD") or "unknown") + ("+" if changed else "")


@cache
def machine() -> str:
    """What class of machine this is."""
    described = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    names = [
        line.partition(":")[2].strip() for line in described.splitlines() if line.startswith("model name")
    ]
    name = names[0] if names else platform.processor() or platform.machine()
    return f"{len(os.sched_getaffinity(0))} cores, {name}, Python {platform.python_version()}"


Rows = dict[tuple[str, str, str, str], list[Figure]]


def _marks(commits: Iterable[str]) -> dict[str, str]:
    """A mark for the figures of each commit."""
    return {commit: f"({number})" for number, commit in enumerate(sorted(commits), start=1)}


def _joined(rows: Rows) -> Rows:
    """Rows of one figure whose cases all have the same value, with other targets, as one."""
    joined: Rows = {}
    last: dict[tuple[str, ...], tuple[str, str, str, str]] = {}
    for (module, name, unit, target), ones in rows.items():
        values, every, targets = {one.shown for one in ones}, ones, target
        same = (module, name, unit, *values)
        if len(values) == 1 and same in last and MISSED not in target + last[same][3]:
            every = [*joined.pop(last[same]), *ones]
            targets = f"{last[same][3]}; {target}"
        last[same] = (module, name, unit, targets)
        joined[module, name, unit, targets] = every
    return joined


def table(figures: Iterable[Figure], present: str) -> str:
    """The figures that have a target as CSV, and what did not come to its end.

    Cases of a benchmark that have the same target share a row, with their different values in the order
    in which they come; a value that several cases have is shown once.
    """
    every = sorted(figures, key=lambda one: one.benchmark.partition("::")[0])
    listed = [one for one in every if one.met is not None or one.name == DID_NOT_END]
    listed = [one for one in listed if not one.target.endswith(" inf")]
    never = [one for one in listed if one.met and one.target == str(NEVER)]
    others = _marks({one.commit for one in every if one.commit.rstrip("+") != present.rstrip("+")})
    alike: Rows = {}
    for one in listed:
        if one not in never:
            target = one.target.replace("at most", "\N{LESS-THAN OR EQUAL TO}")
            marks = [target.replace("at least", "\N{GREATER-THAN OR EQUAL TO}")] if target else []
            marks += [] if one.met else [MISSED]
            marks += [] if one.commit.rstrip("+") == present.rstrip("+") else [others[one.commit]]
            alike.setdefault((_module(one), _name(one), one.unit, ", ".join(marks)), []).append(one)
    alike = _joined(alike)
    rows = [("benchmark", "figure", "measured", "target"), _summary(every, listed, never, present, others)]
    above = ""
    for (module, name, unit, target), ones in alike.items():
        benchmark = f"{module} {', '.join(dict.fromkeys(filter(None, map(_case, ones))))}".strip()
        values = ", ".join(dict.fromkeys(one.shown.removesuffix(unit).strip() for one in ones))
        rows.append(("" if benchmark == above else benchmark, name, f"{values} {unit}".strip(), target))
        above = benchmark
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(
        [" ".join(cell.split()) for cell in row] for row in rows
    )
    return text.getvalue()


def _summary(
    every: list[Figure], listed: list[Figure], never: list[Figure], present: str, others: dict[str, str]
) -> tuple[str, str, str, str]:
    """The row about all figures: of which commit they are, and how many miss their target."""
    machines = "; ".join(sorted({one.machine for one in every}))
    of_others = "".join(f"; {mark} {commit}" for commit, mark in others.items())
    counts = f"{len(every)}; the {len(never)} of what must never happen, and did not, are not listed below"
    missed = f"{sum(not one.met for one in listed)} of {len(listed)} {MISSED}"
    return "all", f"commit {present}{of_others}; {machines}", counts, missed


def _case(figure: Figure) -> str:
    return figure.benchmark.partition("[")[2].removesuffix("]")


def _name(figure: Figure) -> str:
    """The name of a figure without the case that it begins with, so that cases share a row."""
    case, _, name = figure.name.partition(": ")
    return name if name and _case(figure).endswith(case) else figure.name


def _module(figure: Figure) -> str:
    return Path(figure.benchmark.partition("::")[0]).stem.removeprefix("test_")


def main() -> None:
    """Write the table, if there are figures."""
    figures = read(FIGURES)
    if not figures:
        print(f"hexacell: {TABLE.name} stays as it is: make bench has not written {FIGURES.name}")
        return
    # Some benchmarks may have been run again after the pass over all of them.
    [(commit_of_most, _)] = Counter(one.commit for one in figures).most_common(1)
    TABLE.write_text(table(figures, commit_of_most))
    print(f"hexacell: {TABLE.relative_to(CHECKOUT)} has {len(figures)} figures")


if __name__ == "__main__":
    main()
