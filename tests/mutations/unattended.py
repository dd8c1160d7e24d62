"""Trials of what surrounds unattended runs: schedules, notices, and what is told of earlier runs."""

from __future__ import annotations

import random

from hexacell.config.write_record import RECORDS
from tests.mutations.attempts import Attempt, Place, attempt
from tests.mutations.texts import ANY, TOML, mutated
from tests.mutations.trials import CELL, RUN, Templates, files_of, mutated_file, spoiled

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
    command = draw.choice(
        (
            ["history", cell],
            ["history", cell, "--drift"],
            ["history", cell, "--show", "run"],
            ["status", cell],
        )
    )
    return attempt([*command, *draw.choice(([], ["--json"]))], place)


def config_writes_listed(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A cell whose records of writes into its config were mutated; they are listed, and one is added."""
    place.refill(templates.small, templates.small)
    path = place.cell / RUN.parent / RECORDS
    path.write_bytes(mutated(path.read_bytes(), TOML, draw))
    cell = place.cell / CELL
    command = draw.choice((["history", cell, "--changes"], ["rollback", cell]))
    return attempt([*command, *draw.choice(([], ["--json"]))], place)


def run_reported(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A run, in whose folder a file was mutated, that a report is written of."""
    place.refill(templates.small, templates.small)
    folder = place.cell / RUN
    files = files_of(folder)
    path = draw.choice([*files, *[folder / "journal.jsonl"] * len(files)])
    path.write_bytes(mutated_file(path, draw))
    return attempt(["report", folder, "--output", place.cell / f"report.{draw.choice(FORMATS)}"], place)
