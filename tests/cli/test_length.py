"""``hexacell length``, and ``hexacell run --length-check``, as they are typed."""

import re

import pytest

LONG = ("[simulation.encoders]\n", "[simulation.encoders]\ncommon_scale_um_m = 1000.0\n")
BY_HAND = ('mounting = "fixed"', 'mounting = "by-hand"')
CALIBRATE = ("--unattended", "--mode", "optimise")


def without_fixture(text: str) -> str:
    return re.sub(r"^\[length_check\]\n(?:.+\n)*", "", text, flags=re.MULTILINE)


@pytest.mark.slow
def test_a_run_and_the_command_find_the_same_scale_and_the_command_changes_nothing(
    typed_here, typed, quick_cell, few_candidates
) -> None:
    """Of a cell whose encoders are long, with limits that are wide."""
    cell = quick_cell
    cell.edit(LONG)
    outcome = typed_here("run", cell.cell, *CALIBRATE, "--length-check", "--json")
    assert outcome.code == 0, outcome.err
    within = outcome.document["verification"]["accuracy"]["length"]
    assert within["long_um_m"] == pytest.approx(1000.0, abs=within["expanded_um_m"])
    assert "length scale: checked over 300.000 mm: encoders read " in outcome.err
    before = cell.controller.read_bytes()
    alone = typed("length", cell.cell, "--unattended", "--json")
    assert alone.code == 0, alone.err
    document = alone.document
    assert (document["verdict"], document["verification"], document["check"]) == ("pass", None, None)
    result = document["length"]["result"]
    assert result["long_um_m"] == pytest.approx(1000.0, abs=result["expanded_um_m"])
    assert result["is_consistent"] is True
    assert document["length"]["error"]["value"] == pytest.approx(0.19, abs=0.05)
    assert document["line"].startswith("length check over 300.000 mm: encoders read ")
    assert cell.controller.read_bytes() == before
    assert "multiply the scale factor of all encoders by 0.99" in " ".join(alone.err.split())
    assert max(map(len, alone.err.splitlines()[:-2])) <= 80
    *_, last = cell.runs()
    replayed = typed_here("replay", last)
    assert replayed.code == 0, replayed.out


NOTE = "not-begun.json"
"""What a run without a person leaves that did not begin: why, and nothing else."""


def test_a_machine_that_is_not_calibrated_is_refused(typed_here, quick_cell) -> None:
    before = quick_cell.snapshot()
    outcome = typed_here("length", quick_cell.cell, "--unattended")
    assert outcome.code == 2
    assert "no accepted result has this config" in outcome.err
    assert "hexacell run CELL --length-check" in outcome.err
    assert quick_cell.snapshot().items() >= before.items()
    assert_not_begun(quick_cell)


def test_what_has_no_fixture_or_no_length_check_is_refused(typed_here, quick_cell) -> None:
    refused = typed_here("run", quick_cell.cell, "--mode", "check", "--length-check")
    assert (refused.code, "Use `hexacell length`" in refused.err) == (2, True)
    quick_cell.cell.write_text(without_fixture(quick_cell.cell.read_text()))
    for name, *options in (("length",), ("run", *CALIBRATE, "--length-check")):
        outcome = typed_here(name, quick_cell.cell, *options)
        assert outcome.code == 2
        assert f"{quick_cell.cell}: a length check needs a fixture with two seats" in outcome.err
        assert "Add [length_check] with first_seat, distance_mm and uncertainty_mm" in outcome.err
    assert_not_begun(quick_cell)


def assert_not_begun(cell) -> None:
    """There is nothing of a run but a note that says why it did not begin."""
    assert [[path.name for path in run.iterdir()] for run in cell.runs()] == [[NOTE]]


def test_nobody_mounts_the_gauges_of_an_unattended_run(typed_here, quick_cell, few_candidates) -> None:
    quick_cell.edit(BY_HAND)
    outcome = typed_here("run", quick_cell.cell, *CALIBRATE, "--length-check")
    assert outcome.code == 4
    assert "the gauges are mounted in the two seats by hand" in outcome.err
    assert_not_begun(quick_cell)
