"""The test suite of a package that is installed beside hexacell, run as its makers would."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path


def run_own_suite(package: Path, installed: Path, folder: Path, *with_them: str) -> None:
    """Run its tests in ``folder`` against what is installed; ``with_them`` are files that they need."""
    tests = shutil.copytree(package, folder / "package", ignore=shutil.ignore_patterns("hexacell_*"))
    for name in with_them:
        shutil.copy(package / name, tests)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null"]
    ended = subprocess.run(
        [*command, str(tests)],
        env={**os.environ, "PYTHONPATH": str(installed)},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert " passed" in ended.stdout
