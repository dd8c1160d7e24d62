"""The last accepted result, found in the folders of a cell's runs."""

from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import Cell, load_cell
from hexacell.config.change import RECEIPT, Receipt
from hexacell.config.layout import fingerprint
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.accepted_results import last_accepted_result
from hexacell.verdict.decision import Verdict
from hexacell.verdict.model_evidence import ModelTest
from hexacell.verdict.verification import Verification
from procedures.steps import events
from tests.hexacell.services.recorded_nights import Nights
from tests.procedures.story import an_identification
from tests.recorded_events import record

IDENTIFIED = events.Identified(result=an_identification(), held_out=())
PASSED = events.ResultValidated(verdict=Verdict.PASS, line="it is good")


def run(cell: Cell, name: str, *history: events.Event) -> RunFolder:
    """A run that wrote the config which the cell's controller has now, and what happened in it."""
    folder = RunFolder(runs_folder(cell) / name)
    folder.path.mkdir(parents=True)
    written = fingerprint(cell.config_path)
    receipt = Receipt(
        path=cell.config_path,
        format="toml",
        sha256_before="",
        sha256_after=written,
        backup_folder=folder.path,
    )
    receipt.save(folder.path / RECEIPT)
    record(folder.journal, history)
    return folder


def test_of_several_the_newest_counts(cell: Cell) -> None:
    run(cell, "second", IDENTIFIED, PASSED)
    newest = run(cell, "first", IDENTIFIED, PASSED)
    found = last_accepted_result(cell)
    assert found is not None
    assert found.run == str(newest.path)
    np.testing.assert_array_equal(found.covariance, an_identification().covariance)


def test_without_runs_and_for_another_config_there_is_none(cell: Cell) -> None:
    assert last_accepted_result(cell) is None
    run(cell, "run", IDENTIFIED, PASSED)
    cell.config_path.write_bytes(cell.config_path.read_bytes() + b"# changed\n")
    assert last_accepted_result(cell) is None


def judged(*, holds: bool) -> events.ResultValidated:
    """A result that is not certain to be within its limits, of a model that holds or does not."""
    test = ModelTest(name="residuals", passed=holds, sentence="what it says")
    verified = Verification(verdict=Verdict.CONDITIONAL_PASS, tests=(test,))
    return events.ResultValidated(verdict=verified.verdict, line="perhaps", verification=verified)


def test_a_result_that_a_person_kept_counts(cell: Cell) -> None:
    run(cell, "run", IDENTIFIED, judged(holds=True), events.ResultAccepted(by="a person"))
    assert last_accepted_result(cell) is not None


@pytest.mark.parametrize(
    "history",
    [
        (IDENTIFIED,),
        (IDENTIFIED, events.ResultValidated(verdict=Verdict.FAIL, line="it is not")),
        (IDENTIFIED, PASSED, events.RolledBack()),
        (PASSED,),
        (IDENTIFIED, judged(holds=True), events.ResultAccepted(by=None)),
        (IDENTIFIED, judged(holds=False), events.ResultAccepted(by="a person")),
    ],
    ids=["not judged", "out of limits", "rolled back", "a check", "nobody kept it", "no model that holds"],
)
def test_a_result_of_which_nothing_is_known_does_not(cell: Cell, history: tuple[events.Event, ...]) -> None:
    run(cell, "run", *history)
    assert last_accepted_result(cell) is None


def test_runs_that_cannot_be_read_are_left_out(cell: Cell) -> None:
    readable = run(cell, "readable", IDENTIFIED, PASSED)
    run(cell, "damaged", IDENTIFIED, PASSED).journal.write_bytes(b"damaged\n" * 2)
    (run(cell, "without a receipt", IDENTIFIED, PASSED).path / RECEIPT).unlink()
    (runs_folder(cell) / "a file").touch()
    found = last_accepted_result(cell)
    assert found is not None
    assert found.run == str(readable.path)


def test_it_knows_how_warm_the_legs_were(cell: Cell, tmp_path: Path) -> None:
    section = '[[thermometers]]\nname = "x"\npath = "/x"\nlegs = [2, 3]\n'
    cell.path.write_text(f"{cell.path.read_text()}\n{section}")
    told = load_cell(cell.path)
    nights = Nights(told, celsius={"x": 23.5})
    sampled = [nights.taken(record) for record in nights.measured(1, [(0, 0, 0), (5, 0, 0)])]
    run(told, "2026-11-20T120000Z", *sampled, IDENTIFIED, PASSED)
    found = last_accepted_result(told)
    assert found is not None
    assert found.leg_temperatures_c == (None, 23.5, 23.5, None, None, None)
