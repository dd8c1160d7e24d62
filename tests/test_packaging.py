"""What is shipped: sdist and wheel, installed elsewhere; the pins; a program that starts quickly."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
from collections.abc import Iterator
from importlib.metadata import distribution, version
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

CHECKOUT = Path(__file__).parent.parent
VERSION = "0.1.0"
PACKAGES = ("hexacell", "drivers", "procedures")
SLOW_TO_IMPORT = {"scipy", "numpy", "pydantic", "textual", "matplotlib"}
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


def python(*arguments: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python in ``folder``, outside the checkout."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def files_of(folder: str) -> set[str]:
    """Every file in a folder of the checkout, relative to the folder."""
    root = CHECKOUT / folder
    paths = (path for path in root.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(root).as_posix() for path in paths}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the sdist, which is built with what .venv has, so without network."""
    folder = tmp_path_factory.mktemp("built")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, CHECKOUT, folder=folder)
    assert [path.name for path in folder.glob("*.tar.gz")] == [f"hexacell-{VERSION}.tar.gz"]
    [wheel] = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def unpacked(built: Path) -> Path:
    """The wheel's contents."""
    with ZipFile(built) as archive:
        archive.extractall(built.parent / "unpacked")
    return built.parent / "unpacked"


@pytest.fixture(scope="module")
def elsewhere(built: Path) -> Path:
    """A venv with the wheel in it; what the wheel needs is lent to it by this one."""
    folder, venv = built.parent, built.parent / "venv"
    run(sys.executable, "-m", "venv", "--without-pip", venv, folder=folder)
    install = ("install", "--quiet", "--no-index", "--no-deps", "--disable-pip-version-check")
    run(*pip(folder), "--python", venv / "bin" / "python", *install, built, folder=folder)
    # A folder that a .pth file names has its own .pth files ignored: the checkout's among them.
    lent = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site_packages(venv) / "lent.pth").write_text("".join(f"{path}\n" for path in sorted(lent)))
    return venv


def site_packages(venv: Path) -> Path:
    [folder] = venv.glob("lib/python*/site-packages")
    return folder


def contents(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def information(unpacked: Path, name: str) -> str:
    [folder] = unpacked.glob("*.dist-info")
    return (folder / name).read_text()


def test_the_wheel_has_the_three_packages_and_nothing_else(unpacked: Path) -> None:
    found = {name for name in contents(unpacked) if ".dist-info/" not in name}
    expected = {f"{package}/{name}" for package in PACKAGES for name in files_of(package)}
    expected |= {f"hexacell/_configs/{name}" for name in files_of("configs")}
    assert found == expected


def test_the_wheel_is_typed(unpacked: Path) -> None:
    assert {f"{package}/py.typed" for package in PACKAGES} <= contents(unpacked)


def test_the_wheel_is_licensed(unpacked: Path) -> None:
    assert "License-Expression: BSD-3-Clause" in information(unpacked, "METADATA")
    assert "Copyright (c) 2026, the hexacell project" in information(unpacked, "licenses/LICENSE")


def test_the_wheel_announces_the_program_and_the_plugins(unpacked: Path) -> None:
    announced = information(unpacked, "entry_points.txt")
    assert "[console_scripts]\nhexacell = hexacell.__main__:main" in announced
    groups = set(re.findall(r"^\[(hexacell\..*)\]$", announced, flags=re.MULTILINE))
    names = (
        "gauges",
        "simulated_gauges",
        "encoders",
        "controllers",
        "thermometers",
        "config_formats",
        "mechanisms",
    )
    assert groups == {f"hexacell.{name}" for name in names}


def test_the_wheel_finds_its_configs(unpacked: Path, tmp_path: Path) -> None:
    script = "from hexacell.cell import bundled; print(bundled.bundled_config('simulated-hexaglide'))"
    result = python("-c", script, folder=tmp_path, PYTHONPATH=str(unpacked))
    assert result.returncode == 0, result.stderr
    assert Path(result.stdout.strip()) == unpacked / "hexacell/_configs/simulated-hexaglide.toml"


def required(name: str, extras: frozenset[str] = frozenset()) -> Iterator[Requirement]:
    """The direct requirements of an installed distribution that hold on this machine."""
    for text in distribution(name).requires or ():
        requirement = Requirement(text)
        if not requirement.marker or any(
            requirement.marker.evaluate({"extra": extra}) for extra in {"", *extras}
        ):
            yield requirement


def everything_installed() -> set[str]:
    """What the package, its tools and its build need, directly or not."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
    waiting = [Requirement("hexacell[dev]"), *map(Requirement, project["build-system"]["requires"])]
    seen = set()
    while waiting:
        requirement = waiting.pop()
        key = (canonicalize_name(requirement.name), frozenset(requirement.extras))
        if key not in seen:
            seen.add(key)
            waiting += required(*key)
    return {str(name) for name, _ in seen} - {"hexacell"}


def pins() -> dict[str, str]:
    lines = (CHECKOUT / "constraints.txt").read_text().splitlines()
    pairs = [line.split("==") for line in lines if not line.startswith("#")]
    return {canonicalize_name(name): exact for name, exact in pairs}


def test_every_requirement_is_pinned_as_installed_and_nothing_else_is() -> None:
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"]
    compared_with = {Requirement(text).name for text in extras["bench"]}
    installed = {name: exact for name, exact in pins().items() if name not in compared_with}
    assert installed == {name: version(name) for name in everything_installed()}
    assert compared_with <= set(pins())


def test_the_pins_are_versions_only() -> None:
    lines = (CHECKOUT / "constraints.txt").read_text().splitlines()
    assert [line for line in lines if not re.fullmatch(r"#.*|[a-z0-9-]+==[0-9.]+(b[0-9]+)?", line)] == []
    assert lines[1:] == sorted(lines[1:])


def test_help_imports_nothing_slow(tmp_path: Path) -> None:
    result = python("-X", "importtime", "-m", "hexacell", "--help", folder=tmp_path)
    imported = {line.rpartition("|")[2].strip().partition(".")[0] for line in result.stderr.splitlines()}
    assert result.returncode == 0, result.stderr
    assert "hexacell" in imported
    assert imported.isdisjoint(SLOW_TO_IMPORT)


def test_the_installed_program_tells_its_version(elsewhere: Path, tmp_path: Path) -> None:
    assert run(elsewhere / "bin" / "hexacell", "--version", folder=tmp_path).split()[-1] == VERSION


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
