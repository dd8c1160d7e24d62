"""Trials: a kind of input is mutated, and a command is tried on it."""

import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hexacell.config import write_record
from tests.mutations.attempts import Attempt, Place, attempt
from tests.mutations.journals import mutated_journal
from tests.mutations.texts import ANY, CSV, TOML, mutated

CELL, CONFIG, RECORDS = "cell.toml", "simulated-hexaglide.controller.toml", "m.csv"
_ODD = re.compile(r"\w+ = [-+.\de]+\n")
RUN = Path("runs") / "simulated-hexaglide" / "run"
OF_A_RUN = ("cell/runs/*", f"cell/{CONFIG}")
"""What runs, and what undoes them, may change."""


@dataclass(frozen=True)
class Templates:
    """Folders of sound cells.

    Attributes:
        plain: the bundled cell, with a measurement file.
        small: a cell that is calibrated quickly, with a complete run.
        furnished: the bundled cell with every section that a cell file may have.
        interrupted: the small cell with runs that were interrupted late.
    """

    plain: Path
    small: Path
    furnished: Path
    interrupted: tuple[Path, ...]


Trial = Callable[[Templates, Place, random.Random], Attempt]


def mutated_file(path: Path, draw: random.Random) -> bytes:
    """The content of a file, mutated after its kind."""
    if path.suffix == ".jsonl":
        return mutated_journal(path.read_bytes(), draw)
    mutations = {".toml": TOML, ".json": TOML, ".csv": CSV}.get(path.suffix, ANY)
    return mutated(path.read_bytes(), mutations, draw)


def spoiled(
    template: Path, templates: Templates, place: Place, name: Path | str, draw: random.Random
) -> Path:
    """Make a place a copy of a template, in which one file is mutated."""
    place.refill(template, templates.small)
    path = place.cell / name
    path.write_bytes(mutated_file(path, draw))
    return path


def cell_file(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell file that is validated or shown."""
    sound = draw.choice((templates.plain, templates.small, templates.furnished))
    path = spoiled(sound, templates, place, CELL, draw)
    action = draw.choice((["validate"], ["validate", "--json"], ["show"], ["show", "--json"]))
    return attempt(["cell", *action, path], place)


def config(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A controller's config."""
    spoiled(templates.plain, templates, place, CONFIG, draw)
    return attempt(["cell", "validate", place.cell / CELL], place)


def records(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A measurement file."""
    path = spoiled(templates.small, templates, place, RECORDS, draw)
    command = draw.choice(("fit", "fit", "next"))
    return attempt([command, place.cell / CELL, "--measurements", path, "--json"], place)


def cell_file_of_records(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell file with which records are identified."""
    path = spoiled(templates.small, templates, place, CELL, draw)
    command = draw.choice(("fit", "next"))
    return attempt([command, path, "--measurements", place.cell / RECORDS], place)


def journal_replayed(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A journal that is replayed."""
    path = spoiled(templates.small, templates, place, RUN / "journal.jsonl", draw)
    only = draw.choice(("identification", "identification", "identification", "results"))
    return attempt(["replay", path.parent, "--only", only, "--json"], place)


def journal_exported(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A run folder that is exported."""
    name = draw.choice(("journal.jsonl", "proposal.json", "cell.toml", "wire", "config-before"))
    spoiled(templates.small, templates, place, RUN / name, draw)
    return attempt(["replay", place.cell / RUN, "--export", place.cell / "copy"], place)


def journal_beside_records(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A run folder whose records are identified again."""
    path = spoiled(templates.small, templates, place, RUN / "journal.jsonl", draw)
    return attempt(["fit", place.cell / CELL, "--measurements", path.with_name("measurements.csv")], place)


def files_of(folder: Path) -> list[Path]:
    """All files below a folder, always in one order."""
    return [path for path in sorted(folder.rglob("*")) if path.is_file()]


def run_resumed(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A run that is resumed, with a mutated file in its folder."""
    place.refill(draw.choice(templates.interrupted), templates.small)
    folder = place.cell / RUN
    others = [path for path in files_of(folder) if path.name != "journal.jsonl"]
    path = draw.choice(others) if draw.random() < 0.2 else folder / "journal.jsonl"
    path.write_bytes(mutated_file(path, draw))
    named = draw.choice(([], ["run"]))
    command = ["run", place.cell / CELL, "--unattended", "--mode", "optimise", "--resume", *named]
    return attempt(command, place, OF_A_RUN)


def move_out_of_reach(cell: Path) -> None:
    """Let every run of a cell end before it begins."""
    cell.write_text(cell.read_text().replace("[100.0, -100.0, 500.0]", "[100.0, -100.0, 5500.0]"))


def run_checked(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell out of its own reach whose earlier run was mutated: a check reads that, and ends."""
    name = draw.choice(("journal.jsonl", "write-back.json"))
    spoiled(templates.small, templates, place, RUN / name, draw)
    cell = place.cell / CELL
    move_out_of_reach(cell)
    return attempt(["run", cell, "--unattended", "--mode", "check"], place)


ODD_NUMBERS = ("1e-9", "1e-6", "0.0", "-0.0", "1e6", "-1e6", "999999.0", "1e3", "80.0", "0.5", "1", "2")


def odd_cell_file(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell file whose numbers are allowed and make little sense."""
    place.refill(templates.small, templates.small)
    path = place.cell / CELL
    lines = path.read_text().splitlines(keepends=True)
    places = [n for n, line in enumerate(lines) if _ODD.fullmatch(line)]
    for n in draw.sample(places, draw.choice((1, 1, 2, 4))):
        lines[n] = f"{lines[n].partition('=')[0]}= {draw.choice(ODD_NUMBERS)}\n"
    path.write_text("".join(lines))
    (place.cell / "empty.csv").touch()
    records = draw.choice((RECORDS, RECORDS, "empty.csv"))
    if draw.random() < 0.1:
        return attempt(["preflight", path], place)
    command = "next" if records == "empty.csv" else draw.choice(("fit", "next"))
    return attempt([command, path, "--measurements", place.cell / records, "--json"], place)


FORMATS = ("html", "html", "xml", "txt", "")


def cell_file_scheduled(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell file with every section that is scheduled, or whose notices are listed."""
    path = spoiled(templates.furnished, templates, place, CELL, draw)
    units = ["--folder", place.cell / "units"]
    command = draw.choice(
        (["notify", path], ["schedule", path, "--daily", _time(draw), *units], ["status", path])
    )
    return attempt([*command, *draw.choice(([], ["--json"]))], place)


def _time(draw: random.Random) -> str:
    sound = f"{draw.randrange(24):02}:{draw.randrange(60):02}"
    return sound if draw.random() < 0.5 else mutated(sound.encode(), ANY, draw).decode("utf-8", "replace")


def earlier_runs_listed(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell with an earlier run, in whose folder a file was mutated, or the index of all."""
    place.refill(templates.small, templates.small)
    files = files_of(place.cell / RUN)
    if draw.random() < 0.3:
        files = [place.cell / RUN.parent / "index.sqlite"]
        attempt(["history", place.cell / CELL], place)
    path = draw.choice(files)
    if path.exists():
        path.write_bytes(mutated_file(path, draw))
    cell = place.cell / CELL
    of_history = draw.choice(([], ["--drift"], ["--show", "run"]))
    command = draw.choice((["history", cell, *of_history],) * 3 + (["status", cell],))
    return attempt([*command, *draw.choice(([], ["--json"]))], place)


def config_writes_listed(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell whose records of writes into its config were mutated; they are listed, and one is added."""
    place.refill(templates.small, templates.small)
    path = place.cell / RUN.parent / write_record.RECORDS
    path.write_bytes(mutated(path.read_bytes(), TOML, draw))
    cell = place.cell / CELL
    command = draw.choice((["history", cell, "--changes"], ["rollback", cell]))
    return attempt([*command, *draw.choice(([], ["--json"]))], place, OF_A_RUN)


def run_reported(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A run, in whose folder a file was mutated, that a report is written of."""
    place.refill(templates.small, templates.small)
    folder = place.cell / RUN
    files = files_of(folder)
    path = draw.choice([*files, *[folder / "journal.jsonl"] * len(files)])
    path.write_bytes(mutated_file(path, draw))
    return attempt(["report", folder, "--output", place.cell / f"report.{draw.choice(FORMATS)}"], place)
