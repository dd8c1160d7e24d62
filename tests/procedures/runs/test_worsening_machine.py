"""A machine that gets worse during a run, as its cell file states: it is named, and the run ends."""

from typing import Any

import pytest

from hexacell.campaign import planner
from hexacell.text.line_face import event_text
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from tests.procedures.rig import MakeRig
from tests.procedures.runs.listening import happened

FEW: dict[str, Any] = {
    "identification__points": tuple(
        (x, y, 500.0) for x, y in ((90.0, -90.0), (-90.0, 90.0), (0.0, 0.0), (90.0, 90.0))
    ),
    "identification__orientations": 6,
    "verification__points": ((-100.0, -50.0, 450.0),),
    "noise__revisits": 6,
    "simulation__motion__repeatability": 0.003,
    "simulation__motion__growth_per_move": 0.03,
}


async def test_it_is_named_with_both_sizes_and_the_run_ends_with_a_verdict(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planner, "is_well_known", lambda *_: True)  # no pilot poses
    rig = make_rig(**FEW)
    ended = await rig.run()
    (identified,) = happened(rig, events.Identified)
    found = identified.worsening
    assert (found is not None, ended.exit_code) == (True, 0)
    assert (found.is_seen, found.sets) == (True, 2)
    assert found.later_mm > 1.5 * found.first_mm
    told = event_text(identified, fold(read_journal(rig.folder.journal)))
    assert "the machine got worse during the run" in " ".join(str(told).split())
