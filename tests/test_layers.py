"""The import contracts hold, and each of them notices when it is broken."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

CHECKOUT = Path(__file__).parent.parent
PACKAGES = ("hexacell", "drivers", "procedures")
MATHEMATICS = ("kinematics", "limits", "identification", "uncertainty", "motion", "design", "drift")

FORBIDDEN = [
    ("hexacell.errors", "hexacell.cli"),
    ("hexacell.errors", "hexacell.services"),
    ("hexacell.errors", "procedures.run"),
    ("hexacell.errors", "drivers"),
    ("hexacell.text.layout", "hexacell.cli"),
    ("hexacell.services.devices.device_setup", "hexacell.text"),
    ("hexacell.campaign.planner", "drivers.interfaces"),
    ("hexacell.design.candidates", "hexacell.campaign"),
    ("hexacell.motion.trajectory", "hexacell.design"),
    ("hexacell.cli", "drivers.simulated"),
    ("drivers.interfaces", "procedures.run"),
    ("drivers.interfaces", "hexacell.services"),
    ("drivers.interfaces", "drivers.simulated"),
    ("procedures.run", "hexacell.cli"),
    ("procedures.run", "drivers.simulated"),
    ("procedures.run", "procedures.steps"),
    ("procedures.engine", "procedures.replay"),
    ("procedures.calibration", "procedures.journal"),
    ("procedures.guards", "procedures.calibration"),
    ("procedures.devices", "procedures.guards"),
    *((f"hexacell.{module}", "hexacell.cell.model") for module in MATHEMATICS),
    *((f"hexacell.{module}", "pydantic") for module in MATHEMATICS),
]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The sources and their contracts, free to be spoiled."""
    for package in PACKAGES:
        shutil.copytree(
            CHECKOUT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(CHECKOUT / "pyproject.toml", tmp_path)
    return tmp_path


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    """What ``make lint`` runs."""
    command = [str(Path(sys.executable).parent / "lint-imports"), "--no-logo", "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def source_of(module: str, folder: Path) -> Path:
    path = folder.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def test_the_contracts_hold(copy: Path) -> None:
    result = lint_imports(copy)
    assert result.returncode == 0, result.stdout
    assert re.search(r"\b0 broken", result.stdout)


def test_every_forbidden_import_is_caught(copy: Path) -> None:
    for importer, imported in FORBIDDEN:
        with source_of(importer, copy).open("a") as source:
            source.write(f"\nimport {imported}\n")
    result = lint_imports(copy)
    assert result.returncode == 1
    assert " KEPT" not in result.stdout
    missed = [pair for pair in FORBIDDEN if not re.search(r"- +{} -> {} \(".format(*pair), result.stdout)]
    assert missed == []


def test_mathematics_needs_numpy_and_scipy_only() -> None:
    graph = grimp.build_graph("hexacell", include_external_packages=True, cache_dir=None)
    roots = {f"hexacell.{module}" for module in MATHEMATICS}
    modules = roots.union(*(graph.find_descendants(root) for root in roots))
    imported = set[str]().union(*(graph.find_modules_directly_imported_by(module) for module in modules))
    outside = {name.partition(".")[0] for name in imported} - sys.stdlib_module_names - {"hexacell"}
    assert outside <= {"numpy", "scipy"}
