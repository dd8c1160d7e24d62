"""On the wire: backlash, play and compliance are found, corrected in the config, and verified."""

from typing import Any

import pytest

from hexacell.services.run.replay_run import replay
from hexacell.text.terms import run_terms_text
from hexacell.verdict.decision import Verdict
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from tests.native_config import NATIVE

PLAY_MM = (0.1, 0.08, 0.12, 0.1, 0.06, 0.1)
YIELDING: dict[str, Any] = {
    "identification__points": ((100.0, -100.0, 500.0), (-100.0, 100.0, 500.0), (0.0, 0.0, 550.0)),
    "identification__orientations": 12,
    "simulation__joints__backlash": (0.08,) * 6,
    "simulation__legs__play_mm": PLAY_MM,
    "simulation__legs__compliance_um_n": (0.3,) * 6,
    "simulation__load__weight_n": 100.0,
    "uncertainty__own_weight_n": 100.0,
    "noise__encoder": 0.006,
    "noise__gauge_mm": 0.006,
    "simulation__gauges__noise_mm": 0.005,
    "simulation__encoders__noise": 0.005,
}


async def test_the_controller_corrects_what_was_found_and_the_machine_passes(make_site) -> None:
    site = make_site(**YIELDING)
    ended = await site.calibrate()
    [judged] = site.happened(events.ResultValidated)
    assert judged.verdict is Verdict.PASS, ended.line
    terms = site.happened(events.Identified)[0].result.terms
    assert all(one.is_taken for one in terms), terms
    written = NATIVE.read(site.cell.config_path).corrections
    # Some 0.01 mm and 0.05 um/N of a leg are not known.
    assert written.play_mm == pytest.approx(PLAY_MM, abs=0.06)
    assert written.compliance_um_n == pytest.approx((0.3,) * 6, abs=0.3)
    assert written.backlash == pytest.approx((0.08,) * 6, abs=0.05)
    said = run_terms_text(fold(read_journal(site.folder.journal)))
    assert said.count("corrected by the controller") == 3
    assert " mm with the best geometry alone, " in said
    assert judged.verification.after_mm < 0.15 < judged.verification.before_mm
    replayed = await replay(site.folder.path)
    assert not replayed.differences, "a run that is resumed knows of the config's place for corrections"
