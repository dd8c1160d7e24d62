"""The watch over recorded runs: calibrations and checks enter, a crash is told with leg and time."""

from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import Cell, load_cell
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history import run_summary
from hexacell.services.history.drift_history import DriftHistory, drift_history
from hexacell.services.history.run_index import EvidenceDocument
from hexacell.services.history.run_summary import evidence_document
from hexacell.text.history import change_sentence, watch_text
from tests.hexacell.services.proposed_runs import a_cell
from tests.hexacell.services.recorded_nights import Nights

CRASH = {"l4": 0.31}
DRIFT_MM = 0.0012
"""A night: in twelve of them too little for an alarm."""


@pytest.fixture
def nights(tmp_path: Path) -> Nights:
    return Nights(a_cell(tmp_path))


def after(nights: Nights, *numbers: int, crash: dict[str, float]) -> DriftHistory:
    """A calibration, some checks, a crash, and more checks."""
    nights.calibrate()
    for number in numbers:
        for _ in range(number):
            nights.check()
        nights.changes = nights.changes | crash
    return drift_history(nights.cell)


def test_an_unchanged_robot_raises_no_alarm(nights) -> None:
    found = after(nights, 12, crash={})
    assert (len(found.runs), found.changes) == (13, ())
    assert [name for name, _ in found.shares] == list(nights.robot.mechanism.parameters.names)
    assert 0.0 < max(share for _, share in found.shares) < 1.0
    assert watch_text(found).startswith("13 runs from 2026-03-01 to 2026-03-13: no leg has moved:")


def test_a_crash_is_told_with_its_leg_size_and_time(nights) -> None:
    found = after(nights, 8, 2, crash=CRASH)
    (change,) = found.changes
    assert (change.possible_legs[0], change.other_legs) == (4, ())
    assert (change.after.day, change.before.day, change.noticed.day) == (9, 10, 10)
    assert abs(abs(change.change) - 0.31) < 4 * change.sigma + 0.05
    sentence = change_sentence(change)
    assert sentence.startswith("leg 4 moved 0.3")
    assert "between 2026-03-09 02:30 and 2026-03-10 02:30; the others did not." in sentence
    text = watch_text(found)
    assert max(map(len, text.splitlines())) <= 80
    assert "since then" in text


def test_records_that_were_left_out_and_checks_that_do_not_hold_do_not_count(nights) -> None:
    nights.calibrate()
    for _ in range(3):
        nights.check()
    nights.check(spoilt=True, left_out=((1, 5),))
    nights.check(spoilt=True, is_consistent=False)
    found = drift_history(nights.cell)
    assert (len(found.runs), found.changes) == (5, ())
    nights.check(spoilt=True)
    assert drift_history(nights.cell).changes
    nights.check().journal.write_bytes(b"rubbish\nrubbish\n")
    assert len(drift_history(nights.cell).runs) == 6


def test_each_run_is_computed_once_for_what_the_cell_file_states(nights, monkeypatch) -> None:
    computed: list[str] = []

    def noted(settings, folder: RunFolder) -> EvidenceDocument | None:
        computed.append(folder.path.name)
        return evidence_document(settings, folder)

    monkeypatch.setattr(run_summary, "evidence_document", noted)
    after(nights, 2, crash={})
    assert len(computed) == 3
    nights.check()
    assert len(drift_history(nights.cell).runs) == 4
    assert len(computed) == 4
    drift_history(with_other_noise(nights.cell))
    assert len(computed) == 8


def with_other_noise(cell: Cell) -> Cell:
    text = cell.path.read_text()
    cell.path.write_text(text.replace("gauge_mm = 0.01", "gauge_mm = 0.02"))
    assert cell.path.read_text() != text
    return load_cell(cell.path)


STEEL_UM_M_K = 11.5
THERMOMETERS = "".join(
    f'[[thermometers]]\nname = "leg {leg}"\npath = "/nowhere/{leg}"\nlegs = [{leg}]\n\n'
    for leg in range(1, 7)
)


def with_thermometers(cell: Cell) -> Cell:
    """The cell with a thermometer on each leg, and legs of steel."""
    text = cell.path.read_text().replace(
        "[uncertainty]", f"[uncertainty]\nexpansion_legs_um_m_k = {STEEL_UM_M_K}"
    )
    cell.path.write_text(f"{text}\n{THERMOMETERS}")
    found = load_cell(cell.path)
    assert found.settings.uncertainty.expansion_legs_um_m_k == STEEL_UM_M_K
    return found


def warm(nights: Nights, *kelvin: float) -> None:
    """Legs that are so much warmer than 20 deg C, and longer by it."""
    lengths = nights.cell.settings.robot.nominal.model_dump()["l"]
    nights.celsius = {f"leg {leg}": 20.0 + one for leg, one in enumerate(kelvin, start=1)}
    nights.changes = {
        f"l{leg}": 1e-6 * STEEL_UM_M_K * length * one
        for leg, (length, one) in enumerate(zip(lengths, kelvin, strict=True), start=1)
    }


def a_week_of_weather(nights: Nights) -> None:
    warm(nights, *[0.0] * 6)
    nights.calibrate()
    for number in range(8):
        warm(nights, *(7.0 * np.sin(0.7 * number + np.arange(6))).tolist())
        nights.check()


def test_the_expansion_of_legs_with_thermometers_is_no_drift_and_hides_none(nights) -> None:
    bare = nights.cell
    nights.cell = with_thermometers(nights.cell)
    a_week_of_weather(nights)
    found = drift_history(nights.cell)
    assert (len(found.runs), found.changes) == (9, ())
    assert "Their thermometers showed" in watch_text(found)
    assert drift_history(bare).changes
    nights.celsius["leg 3"], silent = None, nights.celsius["leg 3"]
    nights.check()
    assert len(drift_history(nights.cell).runs) == 9, "one whose thermometer was silent does not count"
    nights.celsius["leg 3"] = silent
    nights.changes["l4"] += 0.31
    nights.check()
    (change,) = drift_history(nights.cell).changes
    assert (change.possible_legs[0], change.other_legs) == (4, ())


def test_what_moves_on_steadily_is_of_its_leg(nights) -> None:
    nights.calibrate()
    for number in range(20):
        nights.changes = {"l4": 10 * DRIFT_MM * number}
        nights.check()
    (change,) = drift_history(nights.cell).changes
    assert (change.possible_legs, change.other_legs) == ((4,), ())
    assert change.noticed.day < 10
    assert change.moved_again >= 1
    assert change.last_noticed > change.noticed
    assert "It has moved on since; noticed" in " ".join(change_sentence(change).split())
