"""Packages beside hexacell add what it has not: their own suites pass, and cells use them."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.cli.cell_folder import QUICK, CellFolder, copy_cell

HERE = Path(__file__).parent
NOT_ITS_WORDS = re.compile(r".*\b(?:slider|hexaglide)\w*.*", re.IGNORECASE)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Install a package with what .venv has, so without network; gives the folder that it is then in."""

    @cache
    def install(package: str) -> Path:
        folder = tmp_path_factory.mktemp(package)
        source = shutil.copytree(HERE / package, folder / "source")
        options = ("--quiet", "--no-deps", "--no-build-isolation", "--target", str(folder / "installed"))
        subprocess.run([sys.executable, "-m", "pip", "install", *options, str(source)], check=True)
        return folder / "installed"

    return install


def python(
    *arguments: object, path: Path | None, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Python, with the packages in a folder beside its own."""
    environment = os.environ | ({} if path is None else {"PYTHONPATH": str(path)})
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, env=environment, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("package", "with_it"),
    [
        ("counter_gauge", ()),
        ("scale_box", ("hexacell_scale_box_twin.py",)),
        ("hexapod_box", ("hexacell_hexapod_box_twin.py",)),
    ],
)
def test_its_own_suite_passes(package, with_it, installed, tmp_path):
    """Run as its makers would, against what is installed."""
    ignored = shutil.ignore_patterns("hexacell_*")
    tests = shutil.copytree(HERE / package, tmp_path / "package", ignore=ignored)
    for name in with_it:
        shutil.copy(HERE / package / name, tests)
    options = ("-q", "-p", "no:cacheprovider", "-c", "/dev/null")
    ended = python("-m", "pytest", *options, tests, path=installed(package), cwd=tmp_path)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert " passed" in ended.stdout


@pytest.mark.slow
def test_encoders_are_found_by_the_name_of_their_protocol(installed: Callable[[str], Path]) -> None:
    loaded = "from hexacell.plugins import Group, load; print(load(Group.ENCODERS, 'scale-box').__module__)"
    assert python("-c", loaded, path=installed("scale_box")).stdout.split() == ["hexacell_scale_box"]


@pytest.mark.slow
def test_a_cell_has_the_options_of_a_controller(installed, tmp_path):
    cell = copy_cell(tmp_path)
    cell.edit(('"linuxcncrsh"', '"hexapod-box"\noptions = { robot = "left" }'))
    shown = python("-m", "hexacell", "cell", "show", cell.cell, path=installed("hexapod_box"))
    assert shown.returncode == 0, shown.stderr
    assert re.search(r'(?m)^robot = "left"  # line \d+\nanswer_s = 2\.0  # default$', shown.stdout)
    refused = python("-m", "hexacell", "cell", "show", cell.cell, path=None)
    assert (refused.returncode, "hexapod-box" in refused.stderr) == (2, True)


@pytest.fixture
def counted(tmp_path: Path) -> CellFolder:
    """A cell with the gauge."""
    cell = copy_cell(tmp_path)
    cell.edit(*QUICK, ('protocol = "sylvac"', 'protocol = "counter"'))
    return cell


def test_devices_finds_the_gauge_as_its_twin_serves_it(installed, counted):
    options = ("--diagnose", "x", "--cell", counted.cell, "--seconds", "0.2")
    watched = python("-m", "hexacell", "devices", *options, path=installed("counter_gauge"))
    assert watched.returncode == 0, watched.stderr
    assert "x, counter: COUNTER7" in watched.stdout


@pytest.mark.slow
def test_a_cell_is_calibrated_with_the_gauge(installed: Callable[[str], Path], counted: CellFolder) -> None:
    counted.wait_long_for_devices()
    options = (counted.cell, "--unattended", "--mode", "optimise")
    run = python("-m", "hexacell", "run", *options, path=installed("counter_gauge"))
    assert run.returncode == 0, run.stderr


@pytest.mark.slow
def test_a_mechanism_is_calibrated_on_the_wire_in_its_own_words(installed, tmp_path):
    with_it = installed("ring_mechanism")
    cell = shutil.copytree(HERE / "ring_mechanism/cells", tmp_path / "cells") / "ring.toml"
    refused = python("-m", "hexacell", "cell", "show", cell, path=None)
    assert refused.returncode == 2
    assert "there is no mechanism 'ring'" in " ".join(refused.stderr.split())
    shown = python("-m", "hexacell", "cell", "show", cell, path=with_it)
    assert shown.returncode == 0, shown.stderr
    assert "ring_mm = 1.0" in shown.stdout
    assert "rail_" not in shown.stdout

    run = python(
        "-m", "hexacell", "run", cell, "--unattended", "--mode", "optimise", "--json", path=with_it
    )
    assert run.returncode == 0, run.stderr
    line = json.loads(run.stdout)["line"]
    assert line.startswith("37 parameters, 54 records at 6 points")
    assert line.endswith("(limit 0.3): pass")
    [folder] = (cell.parent / "runs" / "ring").glob("2*")
    measured = folder / "measurements.csv"
    fitted = python("-m", "hexacell", "fit", cell, "--measurements", measured, path=with_it)
    assert fitted.returncode == 0, fitted.stderr
    for text in (run.stderr, fitted.stdout, (folder / "result.json").read_text()):
        assert not NOT_ITS_WORDS.findall(text)
    assert "repeatability of a carriage" in (folder / "result.json").read_text()
