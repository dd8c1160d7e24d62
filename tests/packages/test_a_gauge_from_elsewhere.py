"""A package that is installed beside hexacell adds a gauge: it passes the suite, and a cell uses it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.cell_folder import QUICK, copy_cell
from tests.packages.conftest import Install
from tests.packages.own_suite import run_own_suite
from tests.packages.test_a_mechanism_from_elsewhere import hexacell

PACKAGE = Path(__file__).parent / "counter_gauge"


@pytest.fixture(scope="module")
def installed(install: Install) -> Path:
    """The folder that the package is installed in."""
    return install(PACKAGE)


def test_it_passes_what_every_gauge_must(installed: Path, tmp_path: Path) -> None:
    run_own_suite(PACKAGE, installed, tmp_path)


def test_devices_finds_what_is_served_by_its_twin(installed: Path, tmp_path: Path) -> None:
    cell = copy_cell(tmp_path)
    cell.edit(*QUICK, ('protocol = "sylvac"', 'protocol = "counter"'))
    watched = hexacell(
        "devices", "--diagnose", "x", "--cell", cell.cell, "--seconds", "0.2", path=installed
    )
    assert watched.returncode == 0, watched.stderr
    assert "x, counter: COUNTER7" in watched.stdout


@pytest.mark.slow
def test_a_cell_is_calibrated_with_it(installed: Path, tmp_path: Path) -> None:
    cell = copy_cell(tmp_path)
    cell.edit(*QUICK, ('protocol = "sylvac"', 'protocol = "counter"'))
    cell.wait_long_for_devices()
    run = hexacell("run", cell.cell, "--unattended", "--mode", "optimise", path=installed)
    assert run.returncode == 0, run.stderr


def test_without_the_package_its_protocol_is_refused_by_name(tmp_path: Path) -> None:
    cell = copy_cell(tmp_path)
    cell.edit(('protocol = "sylvac"', 'protocol = "counter"'))
    refused = hexacell("preflight", cell.cell, path=None)
    assert refused.returncode == 2
    assert "there is no gauge protocol 'counter'" in " ".join(refused.stderr.split())
