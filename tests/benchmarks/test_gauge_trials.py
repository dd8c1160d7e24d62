"""Gauges are tried at every station: mistakes are named at the first one, healthy gauges never.

Each run is the real procedure with a robot drawn within the tolerances, on devices without wires.
``TRIALS`` in the environment says how many runs there are, with mistakes and without; a sample of both is
in ``make test`` (``tests/procedures/runs/test_gauge_trial.py``).
"""

import asyncio
from collections.abc import Iterator
from itertools import cycle, islice
from pathlib import Path
from typing import Any

from hexacell.errors import HexacellError
from procedures.journal.journal import read_journal
from procedures.steps import events
from procedures.steps.place import MountingError
from tests.benchmarks.figures import NEVER, at_least
from tests.benchmarks.samples import sample
from tests.procedures.rig import new_rig
from tests.procedures.runs.gauge_mistakes import MISTAKES, drawn_robots, make_mistake
from tests.small_cell import choose_among_few

TRIALS = sample(__name__, "TRIALS")


def rigs(folder: Path, seed: int) -> Iterator[Any]:
    """Runs of drawn robots, with gauges and encoders as noisy as the bundled cell states."""
    noise: dict[str, Any] = {f"simulation__{one}": 0.01 for one in ("gauges__noise_mm", "encoders__noise")}
    noise |= {"noise__gauge_mm": 0.01, "noise__encoder": 0.01, "stations__trial_mm": 1.0}
    noise |= {"stations__placement": "by-hand"}
    first = new_rig(folder)
    for number, geometry in enumerate(drawn_robots(first.cell.settings, seed)):
        place = folder / str(number)
        place.mkdir()
        yield new_rig(place, simulation__geometry=geometry, **noise)


def carried_out(rig: Any) -> tuple[str, list[events.Event]]:
    """What ended a run early, if anything did, and its journal."""
    try:
        asyncio.run(rig.run())
    except MountingError as error:
        return str(error), list(read_journal(rig.folder.journal))
    except HexacellError:
        pass  # so few records do not calibrate every robot
    return "", list(read_journal(rig.folder.journal))


def test_every_mistake_is_named_before_the_second_station(figure, tmp_path, monkeypatch) -> None:
    choose_among_few(monkeypatch)
    named = right = 0
    for rig, mistake in zip(islice(rigs(tmp_path, 21), TRIALS), cycle(MISTAKES), strict=False):
        make_mistake(rig, mistake)
        problem, history = carried_out(rig)
        stations = {event.at for event in history if isinstance(event, events.RecordTaken)}
        named += bool(problem) and len(stations) == 1
        right += MISTAKES[mistake] in problem
    figure("mistakes named at the first station", named, f"of {TRIALS}", at_least(TRIALS))
    figure("of these by their right name", right, f"of {TRIALS}", at_least(0.99 * TRIALS))


def test_no_healthy_gauge_is_blamed(figure, tmp_path, monkeypatch) -> None:
    choose_among_few(monkeypatch)
    blamed = tried = 0
    for rig in islice(rigs(tmp_path, 22), TRIALS):
        problem, history = carried_out(rig)
        blamed += bool(problem)
        tried += sum(isinstance(event, events.GaugesTried) for event in history)
    figure("healthy runs in which a gauge is blamed", blamed, f"of {TRIALS}", NEVER)
    figure("stations at which gauges were tried in these", tried, "", at_least(3 * TRIALS))
