"""Trials as careless or hostile hands make them: outputs, links and arguments."""

import os
import random
from pathlib import Path

from tests.mutations.attempts import Attempt, Place, attempt
from tests.mutations.texts import ADDRESSES, NO_TEXT, SIGNS
from tests.mutations.trials import (
    CELL,
    CONFIG,
    OF_A_RUN,
    RECORDS,
    RUN,
    Templates,
    files_of,
    move_out_of_reach,
)

OUTPUTS = (
    "run {cell} --unattended --mode check --events", "status {cell} --metrics", "status {cell} --log-file",
    "schedule {cell} --daily 02:30 --folder {cell}.units --metrics",
    "schedule {cell} --daily 02:30 --folder",
    "report {run} --output", "replay {run} --export", "simulate {cell} --output", "devices --write",
    "demo --folder",
)  # fmt: skip
OF_RUNS = (
    "history {cell}", "history {cell} --show run", "history {cell} --keep 0 --delete", "status {cell}",
    "report {run}", "replay {run} --only identification", "replay {run} --export {run}-copy", "apply {run}",
    "rollback {cell}", "run {cell} --unattended --mode optimise --resume run",
    "fit {cell} --measurements {run}/measurements.csv",
)  # fmt: skip
TYPED = (
    "devices {text}", "devices --can {text}", "devices loop:// --controller {text}", "history {odd}",
    "status --archive {text}", "history --archive {text}", "status {odd}", "cell show {odd}",
    "fit {odd} --measurements {csv}", "report {run}", "replay {run} --only identification",
    "replay {run} --export {odd}.copy", "apply {run} --reason {text}", "history {cell} --show {text}",
    "history {cell} --compare {text} {text}", "run {cell} --resume {text}", "rollback {cell} --to {text}",
    "{text}", "next {cell} --refused {text} --measurements {csv}",
    "schedule {odd} --folder {odd}.units --daily 02:30", "run {odd} --unattended --events {odd}.events",
    "schedule {cell} --folder {odd}.units --daily {text}", "devices --cell {odd} --diagnose {text}",
    "report {run} --compare {text}",
)  # fmt: skip


def typed(commands: tuple[str, ...], place: Place, draw: random.Random, **named: object) -> list[str]:
    """One of the commands; the names in it may have any signs."""
    names = {"cell": place.cell / CELL, "run": place.cell / RUN, **named}
    return [word.format(**names) for word in draw.choice(commands).split()]


def not_ours(place: Place, draw: random.Random) -> Path:
    """What no option wrote: a file, a folder, a link or another name of either, a device, a pipe."""
    theirs = draw.choice([one for one in files_of(place.root) if one.stat().st_size])
    made = place.cell / draw.choice((Path(), RUN)) / "odd.html"
    match draw.randrange(8):
        case 0 | 1:
            return theirs
        case 2:
            return draw.choice((theirs.parent, Path("/dev/full")))
        case 3:
            made.hardlink_to(theirs)
        case 4:
            os.mkfifo(made)
        case _:
            made.symlink_to(draw.choice((theirs, theirs, theirs.parent, place.root / "absent")))
    return made


def output_named(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """An option that names an output, given what is not its own."""
    place.refill(templates.small, templates.small)
    move_out_of_reach(place.cell / CELL)
    target = not_ours(place, draw)
    reader = os.open(target if target.is_fifo() else os.devnull, os.O_RDWR)
    found = attempt([*typed(OUTPUTS, place, draw), target], place, ("outside/hexacell-*",))
    os.close(reader)
    return found


def run_with_a_link(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """A run folder in which something is a link to elsewhere."""
    place.refill(draw.choice((templates.small, *templates.interrupted)), templates.small)
    run, moved = place.cell / RUN, place.root / "outside" / "moved"
    path = draw.choice([*files_of(run.parent), run / "report.html", run / "proposal.json"])
    if path.exists():
        path.rename(moved)
    path.symlink_to(draw.choice((moved, moved, place.cell / CONFIG, place.cell / CELL, moved.parent)))
    return attempt(typed(OF_RUNS, place, draw), place, OF_A_RUN)


def odd_argument(templates: Templates, place: Place, draw: random.Random) -> Attempt:
    """An address, or signs that act on a terminal or are none, in an argument or in the names of files."""
    place.refill(templates.small, templates.small)
    move_out_of_reach(place.cell / CELL)
    sign = f"a{draw.choice((*SIGNS, NO_TEXT))}z"
    odd, csv, run = (place.cell / name for name in (f"{sign}.toml", f"{sign}.csv", RUN.with_name(sign)))
    for path, name in ((CELL, odd), (RECORDS, csv), (RUN, run)):
        (place.cell / path).rename(name)
    (place.cell / CELL).write_bytes(odd.read_bytes())
    text = draw.choice((sign, *ADDRESSES))
    return attempt(typed(TYPED, place, draw, odd=odd, csv=csv, run=run, text=text), place, OF_A_RUN)
