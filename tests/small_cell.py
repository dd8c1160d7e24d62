"""A cell that is measured quickly and precisely, for tests of whole runs."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from drivers.simulated import robot
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, dump, load_cell
from hexacell.cell.model import CellSettings
from hexacell.design.search_effort import SearchEffort
from hexacell.services import search_effort
from procedures.steps import events

FREE: dict[str, Any] = {
    "identification.provisional": False,
    "limits.turn_deg": 60.0,
    "limits.leg_distance_mm": 0.0,
    "limits.passive_joints.base_cone_deg": 180.0,
    "limits.passive_joints.platform_cone_deg": 180.0,
}
"""Passive joints and legs allow large rotations, from which few records identify the geometry."""

SMALL: dict[str, Any] = FREE | {
    "identification.points": ((100.0, -100.0, 500.0), (-100.0, 100.0, 500.0)),
    "identification.orientations": 9,
    "verification.points": ((-100.0, -50.0, 450.0), (100.0, 100.0, 550.0)),
    "verification.orientations": 3,
    "noise.encoder": 0.0012,
    "noise.gauge_mm": 0.0012,
    "stations.trial_mm": 0.0,
    "noise.standstill_readings": 0,
    "noise.revisits": 0,
    "acceptance.position_mm": 5.0,
    "acceptance.orientation_deg": 2.0,
    "simulation.gauges.noise_mm": 0.001,
    "simulation.gauges.flicker_mm": 0.0002,
    "simulation.encoders.noise": 0.001,
    "simulation.encoders.flicker": 0.0002,
}
"""As few poses as identify it, by dotted keys of the cell file."""


FEW_CHOICES = SearchEffort(
    candidates=64,
    held_out_candidates=128,
    checked_candidates=8,
    checked_robots=4,
    rounds=(),
    late_rounds=(),
)
"""Poses are chosen among few that nothing refines, and a plan is checked on few robots: what is chosen is
not under test."""


def changed(section: Any, changes: dict[str, Any]) -> Any:
    """A section of the cell file with other values at some dotted keys."""
    for key, value in changes.items():
        head, _, rest = key.partition(".")
        inner = changed(getattr(section, head), {rest: value}) if rest else value
        section = section.model_copy(update={head: inner})
    return section


def choose_among_few(patch: pytest.MonkeyPatch) -> None:
    """Have the program's services choose among few poses, and the simulated robot move in few pieces."""
    patch.setattr(search_effort, "EFFORT", FEW_CHOICES)
    patch.setattr(robot, "LINE_STEPS", 8)


@contextmanager
def few_candidates() -> Iterator[None]:
    """Choose among few poses for a while."""
    with pytest.MonkeyPatch.context() as patch:
        choose_among_few(patch)
        yield


def write_small_cell(folder: Path, changes: dict[str, Any], timeout_s: float) -> Cell:
    """The demo's cell with some changes in a folder, and its controller's config if there is none yet.

    Its gauges wait ``timeout_s`` on a busy machine.
    """
    source = load_cell(bundled_config("simulated-hexaglide"))
    patient = tuple(gauge.model_copy(update={"timeout_s": timeout_s}) for gauge in source.settings.gauges)
    settings: CellSettings = changed(source.settings, {"gauges": patient} | changes)
    path = folder / "cell.toml"
    path.write_text(dump(settings))
    if not (folder / settings.controller.config).exists():
        shutil.copy(source.config_path, folder)
    return load_cell(path)


def history_until(
    history: Sequence[events.Event], *kinds: type[Any], count: int = 1
) -> tuple[events.Event, ...]:
    """The events up to and with the ``count``-th of these kinds."""
    places = [place for place, event in enumerate(history) if isinstance(event, kinds)]
    return tuple(history[: places[count - 1] + 1])
