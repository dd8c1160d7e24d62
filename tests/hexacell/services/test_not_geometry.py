"""On the wire: what is not geometry is found, corrected in the config, and verified; a machine a row."""

import re
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
    "noise__encoder": 0.006,
    "noise__gauge_mm": 0.006,
    "simulation__gauges__noise_mm": 0.005,
    "simulation__encoders__noise": 0.005,
}
KEYS = {"backlash": "joints__backlash", "play": "legs__play_mm", "compliance": "legs__compliance_um_n"}
ROWS: tuple[dict[str, float], ...] = (
    {"backlash": 0.08},
    {"backlash": 0.04},
    {"backlash": 0.2, "warmer_k": 3.0},
    {"play": 0.08},
    {"compliance": 0.3},
    {"backlash": 0.067, "play": 0.067, "too little": 0.1},  # which 24 records do not show
)
HEAVY = {"simulation__load__weight_n": 100.0, "uncertainty__own_weight_n": 100.0}


def worn_by(warmer_k: float = 0.0, **sizes: float) -> dict[str, Any]:
    """A cell with what is not geometry, alike in all joints and legs; under a weight where that matters."""
    keys = KEYS | {"too little": KEYS["compliance"]}
    worn = {f"simulation__{keys[name]}": (size,) * 6 for name, size in sizes.items()}
    heavy = {} if sizes.keys() == {"backlash"} else HEAVY
    return worn | heavy | {"simulation__temperature__rise_k": warmer_k}


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=str)
async def test_the_controller_corrects_what_was_found_and_the_machine_passes(make_site, row) -> None:
    site, sizes = make_site(**WORN | worn_by(**row)), {name: row[name] for name in KEYS if name in row}
    ended = await site.calibrate()
    [judged] = site.happened(events.ResultValidated)
    assert judged.verdict is Verdict.PASS, ended.line
    terms = site.happened(events.Identified)[0].result.terms
    assert [one.name for one in terms if one.is_taken] == [*sizes]
    written = NATIVE.read(site.cell.config_path).corrections
    for name in KEYS:
        size = sizes.get(name, 0.0)
        assert written.of(name) == pytest.approx((size,) * 6, abs=0.7 * size), "some 0.01 mm are not known"
    said = run_terms_text(fold(read_journal(site.folder.journal)))
    assert said.count("corrected by the controller") == len(sizes)
    assert " mm with the best geometry alone, " in said
    assert judged.verification.after_mm < 0.15 < judged.verification.before_mm
    replayed = await replay(site.folder.path)
    assert not replayed.differences, "a run that is resumed knows of the config's place for corrections"


@pytest.mark.slow
async def test_a_controller_that_reports_success_and_corrects_nothing_is_found_and_rolled_back(make_site):
    """It reports its joints without backlash either way: no answer contradicts another, the gauges do."""
    site = make_site(**WORN, **worn_by(backlash=0.08))
    before = site.config
    site.simulated.faults.inject("ignored corrections", "controller")
    ended = await site.calibrate()
    [judged] = site.happened(events.ResultValidated)
    assert site.happened(events.Committed), "the controller took it"
    assert judged.verdict is Verdict.NOT_EVALUATED, ended.line
    assert re.search(r"\(The controller adds \d % of the corrections in its config", ended.line)
    assert site.config == before, "rolled back"
