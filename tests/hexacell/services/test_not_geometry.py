"""On the wire: backlash and compliance are found, corrected in the config, and verified."""

from typing import Any

import pytest

from hexacell.services.run.replay_run import replay
from hexacell.text.terms import run_terms_text
from hexacell.verdict.decision import Verdict
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from tests.native_config import NATIVE

WORN: dict[str, Any] = {
    "identification__orientations": 12,
    "simulation__joints__backlash": (0.08,) * 6,
    "simulation__legs__compliance_um_n": (1.0,) * 6,
    "simulation__load__weight_n": 100.0,
    "uncertainty__own_weight_n": 100.0,
    "noise__encoder": 0.006,
    "noise__gauge_mm": 0.006,
    "simulation__gauges__noise_mm": 0.005,
    "simulation__encoders__noise": 0.005,
}
"""Play is no part of it: which side a leg lies on that hardly anything pulls is chance."""


async def test_the_controller_corrects_what_was_found_and_the_machine_passes(make_site) -> None:
    site = make_site(**WORN)
    ended = await site.calibrate()
    [judged] = site.happened(events.ResultValidated)
    assert judged.verdict is Verdict.PASS, ended.line
    terms = site.happened(events.Identified)[0].result.terms
    assert [one.name for one in terms if one.is_taken] == ["backlash", "compliance"]
    written = NATIVE.read(site.cell.config_path).corrections
    # Some 0.02 mm and 0.3 um/N of a leg are not known.
    assert not any(written.play_mm)
    assert written.compliance_um_n == pytest.approx((1.0,) * 6, abs=1.0)
    assert written.backlash == pytest.approx((0.08,) * 6, abs=0.08)
    said = run_terms_text(fold(read_journal(site.folder.journal)))
    assert said.count("corrected by the controller") == 2
    assert " mm with the best geometry alone, " in said
    assert judged.verification.after_mm < 0.15 < judged.verification.before_mm
    replayed = await replay(site.folder.path)
    assert not replayed.differences, "a run that is resumed knows of the config's place for corrections"
