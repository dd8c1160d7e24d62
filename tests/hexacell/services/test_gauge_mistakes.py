"""Mistakes with the gauges, on the wire and from the start of a run: named before the second station."""

import pytest

from hexacell.cell.simulation import FaultKind, SimulatedFault
from hexacell.errors import ExitCode, HexacellError
from procedures.steps import events

MISTAKES: list[tuple[FaultKind, str, str, int]] = [
    ("reversed", "x", "gauge x: counts the wrong way", 1),
    ("exchanged", "y", "gauges y, z: are exchanged", 1),
    ("frozen", "z", "gauge z: does not follow the ball", 1),
    ("in inches", "x", "gauge x: answers in inch", 0),
    ("off its middle", "y", r"gauge y: its plunger stands [34]\.\d mm from the middle", 0),
]
"""What, of which gauge, what is said, and how many records were taken before."""


@pytest.mark.parametrize(("kind", "gauge", "words", "records"), MISTAKES)
async def test_a_mistake_at_the_start_is_named(make_site, kind, gauge, words, records) -> None:
    fault = SimulatedFault(kind=kind, device=gauge)
    site = make_site(stations__trial_mm=1.0, simulation__faults=(fault,))
    with pytest.raises(HexacellError, match=words) as refusal:
        await site.calibrate()
    assert refusal.value.exit_code is ExitCode.HARDWARE
    taken = site.happened(events.RecordTaken) if site.folder.journal.exists() else []
    assert len(taken) == records
