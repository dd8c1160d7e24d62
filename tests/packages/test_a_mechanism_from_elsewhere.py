"""A package that is installed beside hexacell adds a mechanism: its cell is calibrated like any other."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.packages.conftest import Install

PACKAGE = Path(__file__).parent / "ring_mechanism"
NOT_ITS_WORDS = re.compile(r".*\b(?:slider|hexaglide)\w*.*", re.IGNORECASE)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def installed(install: Install) -> Path:
    """The folder that the package is installed in."""
    return install(PACKAGE)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shutil.copytree(PACKAGE / "cells", tmp_path_factory.mktemp("cell") / "cells") / "ring.toml"


def hexacell(*arguments: object, path: Path | None) -> subprocess.CompletedProcess[str]:
    """The program, with the packages in a folder beside its own."""
    environment = {**os.environ, **({} if path is None else {"PYTHONPATH": str(path)})}
    command = [sys.executable, "-m", "hexacell", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_without_the_package_its_cell_is_refused_by_name(cell: Path) -> None:
    refused = hexacell("cell", "show", cell, path=None)
    assert refused.returncode == 2
    assert "there is no mechanism 'ring'" in " ".join(refused.stderr.split())


def test_its_parameters_are_those_of_the_cell_file(installed: Path, cell: Path) -> None:
    shown = hexacell("cell", "show", cell, path=installed)
    assert shown.returncode == 0, shown.stderr
    assert "ring_mm = 1.0" in shown.stdout
    assert "rail_" not in shown.stdout


def test_it_is_calibrated_on_the_wire_in_its_own_words(installed: Path, cell: Path) -> None:
    run = hexacell("run", cell, "--unattended", "--mode", "optimise", "--json", path=installed)
    assert run.returncode == 0, run.stderr
    line = json.loads(run.stdout)["line"]
    assert line.startswith("37 parameters, 54 records at 6 points")
    assert line.endswith("(limit 0.3): pass")
    [folder] = (cell.parent / "runs" / "ring").glob("2*")
    fitted = hexacell("fit", cell, "--measurements", folder / "measurements.csv", path=installed)
    assert fitted.returncode == 0, fitted.stderr
    for text in (run.stderr, fitted.stdout, (folder / "result.json").read_text()):
        assert not NOT_ITS_WORDS.findall(text)
    assert "repeatability of a carriage" in (folder / "result.json").read_text()
