"""A package installed beside hexacell adds encoders: it passes the suite, and a cell file may name them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.packages.conftest import Install
from tests.packages.own_suite import run_own_suite

PACKAGE = Path(__file__).parent / "scale_box"
LOADED = """
from hexacell.plugins import Group, load
print(load(Group.ENCODERS, "scale-box").__module__)
"""


@pytest.fixture(scope="module")
def installed(install: Install) -> Path:
    """The folder that the package is installed in."""
    return install(PACKAGE)


def test_they_pass_what_all_encoders_must(installed: Path, tmp_path: Path) -> None:
    run_own_suite(PACKAGE, installed, tmp_path, "hexacell_scale_box_twin.py")


def test_their_protocol_is_found_by_its_name(installed: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    ended = subprocess.run(
        [sys.executable, "-c", LOADED], env=environment, capture_output=True, text=True, check=True
    )
    assert ended.stdout.split() == ["hexacell_scale_box"]
