"""What is shipped: the wheel's contents, the pins, and a program that starts quickly."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import distribution, version
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

CHECKOUT = Path(__file__).parent.parent
PACKAGES = ("hexacell", "drivers", "procedures")
SLOW_TO_IMPORT = {"scipy", "numpy", "pydantic", "textual", "matplotlib"}


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
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel's contents, built with what .venv has, so without network."""
    folder = tmp_path_factory.mktemp("wheel")
    command = ["-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(CHECKOUT)]
    result = python(*command, folder=folder)
    assert result.returncode == 0, result.stdout + result.stderr
    [wheel] = folder.glob("*.whl")
    with ZipFile(wheel) as archive:
        archive.extractall(folder / "unpacked")
    return folder / "unpacked"


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
    compared_with = {Requirement(text).name for text in (*extras["bench"], *extras["peers"])}
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
