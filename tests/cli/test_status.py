"""``hexacell status``: cells at a glance, and metrics that Prometheus' own parser reads."""

import os
from dataclasses import replace
from datetime import timedelta

import pytest
from prometheus_client.parser import text_string_to_metric_families

from hexacell.cell.loader import load_cell
from hexacell.runs.cell_lock import cell_lock
from procedures.journal.journal import encode, read_entries
from tests.hexacell.services.recorded_nights import Nights


def samples(path) -> dict[tuple[str, ...], float]:
    """By name and labels other than the cell."""
    families = text_string_to_metric_families(path.read_text())
    found = {}
    for family in families:
        assert family.documentation
        for sample in family.samples:
            further = sorted(text for name, text in sample.labels.items() if name != "cell")
            found[(sample.name.removeprefix("hexacell_"), *further)] = sample.value
    return found


def test_a_calibrated_cell_and_one_without_runs(typed_here, demo, calibrated, cell_folder) -> None:
    before = cell_folder.snapshot()
    outcome = typed_here("status", calibrated, cell_folder.cell, "--json")
    assert outcome.code == 0, outcome.err
    first, second = outcome.document["cells"]
    accuracy = demo.outcome.document["verification"]["accuracy"]["position"]
    assert (first["verdict"], second["verdict"]) == ("pass", None)
    assert (first["position_mm"], first["expanded_mm"]) == (accuracy["value"], accuracy["expanded"])
    assert first["passed_at"] == first["judged_at"] is not None
    assert (first["in_use_by"], first["proposal"], first["changes"]) == (None, None, 0)
    assert second["in_force"] is None
    lines = outcome.err.splitlines()
    assert lines[1].split()[:2] == ["simulated-hexaglide", "pass"]
    assert lines[2].split() == ["simulated-hexaglide", "-", "-", "-", "no"]
    assert cell_folder.snapshot() == before


def test_metrics_are_those_of_the_latest_verdict(typed_here, demo, calibrated, tmp_path) -> None:
    target = tmp_path / "hexacell.prom"
    target.write_text("# HELP hexacell_in_use of yesterday\n")
    text = calibrated.read_text().replace("[acceptance]\n", "[acceptance]\nvalid_days = 30\n", 1)
    calibrated.write_text(text.replace('name = "simulated-hexaglide"', 'name = "Zelle (3) #+"', 1))
    (calibrated.parent / "runs/simulated-hexaglide").rename(calibrated.parent / "runs/Zelle (3) #+")
    outcome = typed_here("status", calibrated, "--metrics", target)
    assert (outcome.code, "calibration due on " in outcome.out) == (0, True)
    families = text_string_to_metric_families(target.read_text())
    assert {one.labels["cell"] for family in families for one in family.samples} == {"Zelle (3) #+"}
    found = samples(target)
    lasts = found[("calibration_due_timestamp_seconds",)] - found[("calibration_timestamp_seconds",)]
    assert lasts == pytest.approx(30 * 86_400)
    accuracy = demo.outcome.document["verification"]["accuracy"]["position"]
    assert found[("position_error_mm",)] == accuracy["value"]
    assert found[("position_limit_mm",)] == 0.3
    assert (found[("last_verdict", "pass")], found[("last_verdict", "fail")]) == (1.0, 0.0)
    assert found[("last_run_passed",)] == 1.0
    assert found[("last_pass_timestamp_seconds",)] == found[("last_run_timestamp_seconds",)] > 1.7e9
    assert (found[("in_use",)], found[("open_proposal",)], found[("changes_found",)]) == (0.0, 0.0, 0.0)


def test_the_parameter_whose_sum_is_largest_is_collected(typed_here, cell_folder, tmp_path) -> None:
    nights = Nights(load_cell(cell_folder.cell))
    nights.calibrate()
    for _ in range(4):
        nights.check()
    target = tmp_path / "hexacell.prom"
    assert typed_here("status", cell_folder.cell, "--metrics", target).code == 0
    shares = typed_here("history", cell_folder.cell, "--drift", "--json").document["shares_of_limit"]
    name = max(shares, key=shares.__getitem__)
    assert samples(target)[("largest_sum_ratio", name)] == pytest.approx(shares[name])


def test_who_holds_a_cell_is_told_and_nobody_is_kept_out(typed_here, cell_folder) -> None:
    with cell_lock(cell_folder.controller):
        used = typed_here("status", cell_folder.cell)
    assert "by process " in used.out
    assert typed_here("status", cell_folder.cell).out.splitlines()[1].endswith(" no")
    with cell_lock(cell_folder.controller):
        pass


def test_a_run_that_ended_in_the_future_is_told(typed_here, demo, calibrated) -> None:
    """It would hide each night that follows until the clock has reached it."""
    journal = calibrated.parent / "runs" / "simulated-hexaglide" / "demo" / "journal.jsonl"
    entries = read_entries(journal)
    assert "in the future" not in typed_here("status", calibrated).out
    late = [replace(entry, at=entry.at + timedelta(days=400)) for entry in entries]
    journal.write_bytes(b"".join(map(encode, late)))
    assert "demo ended in the future: this computer's clock" in typed_here("status", calibrated).out


def test_a_broken_cell_hides_no_other(typed_here, cell_folder, tmp_path) -> None:
    broken, target = tmp_path / "broken.toml", tmp_path / "hexacell.prom"
    text = cell_folder.cell.read_text()
    for content, reason in (
        (None, "broken.toml"),
        (text.replace("[robot]", "[robot", 1), "broken.toml"),
        (text.replace("position_mm = 0.3 ", 'position_mm = "wide"', 1), "broken.toml"),
        (text, "simulated-hexaglide.controller.toml"),
    ):
        if content is not None:
            broken.write_text(content)
        outcome = typed_here("status", broken, cell_folder.cell, "--json", "--metrics", target)
        assert outcome.code == 2
        assert [one["name"] for one in outcome.document["cells"]] == ["simulated-hexaglide"]
        (told,) = outcome.document["unreadable"]
        assert (told["cell"], reason in told["error"]) == (str(broken), True)
        assert "broken.toml            cannot be read" in outcome.err
        assert ("in_use",) in samples(target)


@pytest.mark.parametrize("name", ["new\nline", "\udcff", "/".join("long" for _ in range(250))])
def test_a_cell_may_be_in_any_folder(typed_here, cell_folder, name) -> None:
    folder = cell_folder.path.parent / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    outcome = typed_here("status", cell_folder.path.rename(folder) / cell_folder.cell.name)
    assert outcome.code == 0, outcome.err


def test_what_a_pattern_names_beside_the_cells_is_passed_over(typed_here, cell_folder) -> None:
    passwords = cell_folder.path / "notify.toml"
    passwords.write_text('token = "hidden"\n')
    outcome = typed_here("status", *sorted(cell_folder.path.glob("*.toml")), "--json")
    assert outcome.code == 0, outcome.err
    assert (len(outcome.document["cells"]), outcome.document["unreadable"]) == (1, [])
    assert typed_here("status", passwords).code == 2


def test_the_metrics_can_be_read_by_who_collects_them(typed_here, cell_folder, tmp_path) -> None:
    """The service that writes them lets nobody read what it makes."""
    target, before = tmp_path / "hexacell.prom", os.umask(0o077)
    try:
        assert typed_here("status", cell_folder.cell, "--metrics", target).code == 0
    finally:
        os.umask(before)
    assert target.stat().st_mode & 0o777 == 0o644
    target.chmod(0o640)
    assert typed_here("status", cell_folder.cell, "--metrics", target).code == 0
    assert target.stat().st_mode & 0o777 == 0o640
