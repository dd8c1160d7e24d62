"""The wheel, installed outside the checkout, runs the demo without the checkout."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
CELL = "simulated-hexaglide.toml"

# Fewer records and wide limits, on a cell that lives fast.
QUICK = (
    ("clock_factor = 150.0", "clock_factor = 600.0"),
    ("give_up_s = 60.0", "give_up_s = 6000.0"),
    ("orientations = 11", "orientations = 7"),
    ("platform_cone_deg = 45.0", "platform_cone_deg = 90.0"),
    ("orientations = 6", "orientations = 2"),
    ("position_mm = 0.3 ", "position_mm = 20.0"),
    ("orientation_deg = 0.08", "orientation_deg = 5.0"),
    # Each test of the model fails one healthy run in a thousand, and the suite has hundreds of runs.
    ("encoder_mm = 0.01\ngauge_mm = 0.01", "encoder_mm = 0.014\ngauge_mm = 0.014"),
)

GAUGES = [
    "cdi",
    "digimatic-usb",
    "heidenhain-nd",
    "keyence-dl-rs1a",
    "mitutoyo-id-h",
    "modbus",
    "mux10",
    "request",
    "stream",
    "sylvac",
    "uwave",
    "visa",
]


def run(*command: object, folder: Path) -> str:
    """What a command prints that ends well, in ``folder`` and without what leads to the checkout."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    ended = subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def pip(folder: Path) -> list[str]:
    """A pip that can install into other environments; .venv need not have one of its own."""
    for python in (sys.executable, "python3"):
        found = subprocess.run(
            [python, "-m", "pip", "--version"], cwd=folder, capture_output=True, check=False
        )
        if found.returncode == 0:
            return [python, "-m", "pip"]
    pytest.fail("there is no pip")


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A venv with the wheel in it; what the wheel needs is lent to it by this one."""
    folder = tmp_path_factory.mktemp("elsewhere")
    build = ("-m", "build", "--wheel", "--no-isolation", "--outdir", folder)
    run(sys.executable, *build, CHECKOUT, folder=folder)
    [wheel] = folder.glob("*.whl")
    venv = folder / "venv"
    run(sys.executable, "-m", "venv", "--without-pip", venv, folder=folder)
    install = ("install", "--quiet", "--no-index", "--no-deps", "--disable-pip-version-check")
    run(*pip(folder), "--python", venv / "bin" / "python", *install, wheel, folder=folder)
    # A folder that a .pth file names has its own .pth files ignored: the checkout's among them.
    lent = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site_packages(venv) / "lent.pth").write_text("".join(f"{path}\n" for path in sorted(lent)))
    return venv


def site_packages(venv: Path) -> Path:
    [folder] = venv.glob("lib/python*/site-packages")
    return folder


def test_the_installed_wheel_does_not_use_the_checkout(elsewhere: Path, tmp_path: Path) -> None:
    script = """
import json, sys
import drivers, hexacell, procedures
from hexacell.cell.bundled import bundled_config
from hexacell.plugins import Group, names
files = [module.__file__ for module in (drivers, hexacell, procedures)]
files.append(str(bundled_config("simulated-hexaglide")))
plugins = {group.entry_points: names(group) for group in Group}
print(json.dumps({"path": sys.path, "files": files, "plugins": plugins}))
"""
    found = json.loads(run(elsewhere / "bin" / "python", "-c", script, folder=tmp_path))
    installed = site_packages(elsewhere)
    assert all(installed in Path(path).parents for path in found["files"])
    assert CHECKOUT not in {(tmp_path / path).resolve() for path in found["path"]}
    assert found["plugins"]["hexacell.gauges"] == GAUGES
    assert found["plugins"]["hexacell.simulated_gauges"] == GAUGES
    assert all(found["plugins"].values())


def check_demo(venv: Path, folder: Path, records: int) -> None:
    """A set may end a record or two early, where no orientation is surely safe."""
    said = run(venv / "bin" / "hexacell", "demo", folder=folder).splitlines()
    found = re.match(r"35 parameters, (\d+) records at 5 points; mean deviation at held-out", said[-1])
    assert found
    assert records - 5 <= int(found[1]) <= records
    assert said[-1].endswith(": pass")
    result = folder / "hexacell-demo" / "runs" / "simulated-hexaglide" / "demo" / "result.json"
    assert json.loads(result.read_text())["converged"] is True


@pytest.mark.slow
def test_the_installed_demo_passes_with_a_small_cell(elsewhere: Path, tmp_path: Path) -> None:
    cell = site_packages(elsewhere) / "hexacell" / "_configs" / CELL
    as_it_comes = text = cell.read_text()
    for old, new in QUICK:
        assert text.count(old) == 1
        text = text.replace(old, new)
    cell.write_text(text)
    try:
        check_demo(elsewhere, tmp_path, records=35)
    finally:
        cell.write_text(as_it_comes)


@pytest.mark.slow
def test_the_installed_demo_passes_unchanged(elsewhere: Path, tmp_path: Path) -> None:
    check_demo(elsewhere, tmp_path, records=55)
