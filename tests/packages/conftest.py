"""Packages that are installed beside hexacell, each in a folder of its own."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Install = Callable[[Path], Path]


@pytest.fixture(scope="session")
def install(tmp_path_factory: pytest.TempPathFactory) -> Install:
    """Installs a package with what .venv has, so without network; the folder that it is in then."""

    def installed(package: Path) -> Path:
        folder = tmp_path_factory.mktemp("installed")
        source = shutil.copytree(package, tmp_path_factory.mktemp("source") / "package")
        options = ("--quiet", "--no-deps", "--no-build-isolation", "--target", str(folder))
        subprocess.run([sys.executable, "-m", "pip", "install", *options, str(source)], check=True)
        return folder

    return installed
