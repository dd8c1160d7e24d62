"""A cell that is measured quickly and precisely, for tests of whole runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from drivers.simulated import robot
from procedures.calibration import measuring, workflow
from procedures.run import events

FREE: dict[str, Any] = {
    "identification.provisional": False,
    "limits.turn_deg": 180.0,
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


def changed(section: Any, changes: dict[str, Any]) -> Any:
    """A section of the cell file with other values at some dotted keys."""
    for key, value in changes.items():
        head, _, rest = key.partition(".")
        inner = changed(getattr(section, head), {rest: value}) if rest else value
        section = section.model_copy(update={head: inner})
    return section


def choose_among_few(patch: pytest.MonkeyPatch) -> None:
    """Choose among few poses, and move there in few pieces: what is chosen is not under test."""
    patch.setattr(workflow, "CANDIDATES", 64)
    patch.setattr(measuring, "HELD_OUT_CANDIDATES", 128)
    patch.setattr(robot, "LINE_STEPS", 8)


def history_until(
    history: Sequence[events.Event], *kinds: type[Any], count: int = 1
) -> tuple[events.Event, ...]:
    """The events up to and with the ``count``-th of these kinds."""
    places = [place for place, event in enumerate(history) if isinstance(event, kinds)]
    return tuple(history[: places[count - 1] + 1])
