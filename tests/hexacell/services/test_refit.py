"""An old run identified again: the same as then, unless the cell file says something else now."""

from __future__ import annotations

from pathlib import Path

import pytest

from hexacell.cell.loader import load_cell
from hexacell.errors import UsageError
from hexacell.services.history.refit import refit_run
from hexacell.text.old_runs import refit_text
from tests.hexacell.services.proposed_runs import a_cell
from tests.hexacell.services.recorded_nights import Nights


@pytest.fixture
def nights(tmp_path: Path) -> Nights:
    return Nights(a_cell(tmp_path))


def test_under_the_same_model_it_is_the_same(nights) -> None:
    folder = nights.calibrate()
    found = refit_run(nights.cell, folder.path.name)
    assert len(found.parameters) == 35
    assert max(abs(one.change) for one in found.parameters) < 1e-6
    assert found.today.chi2 == pytest.approx(found.then.chi2)
    text = refit_text(found)
    assert "identified again" in text
    assert max(map(len, text.splitlines())) <= 80


def test_another_stated_noise_changes_sigma_and_chi_square(nights) -> None:
    folder = nights.calibrate()
    text = nights.cell.path.read_text()
    nights.cell.path.write_text(text.replace("gauge_mm = 0.01", "gauge_mm = 0.02"))
    found = refit_run(load_cell(nights.cell.path), str(folder.path))
    assert found.today.chi2 < 0.95 * found.then.chi2
    assert 0.0 < abs(found.largest.change) < 3 * found.largest.sigma


def test_a_check_measures_too_little(nights) -> None:
    with pytest.raises(UsageError, match="identified no geometry"):
        refit_run(nights.cell, nights.check().path.name)
    with pytest.raises(UsageError, match="there is no run"):
        refit_run(nights.cell, "never")
