"""Geometries of published robots do the whole job on the wire; none is refused, or left to a person.

Two of them are bundled; the others are beside this file. All state the tolerances and the noise of their
makers' class: micrometres, tenths and whole millimetres.
"""

import shutil
from pathlib import Path

import pytest

from hexacell.cell.bundled import CONTROLLER
from tests.cli.commands import Outcome, run_command

HERE = Path(__file__).parent
CONFIGS = HERE.parents[1] / "configs"
CELLS = (CONFIGS / "camera-hexapod.toml", CONFIGS / "wpi-hexapod.toml", HERE / "sps01.toml")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=CELLS, ids=[one.stem for one in CELLS])
def cell(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy, as a calibration writes beside its cell file."""
    path: Path = request.param
    folder = tmp_path_factory.mktemp(path.stem)
    shutil.copy(path.with_name(path.stem + CONTROLLER), folder)
    return Path(shutil.copy(path, folder))


@pytest.fixture(scope="module")
def preflight(cell: Path) -> Outcome:
    return run_command(cell.parent, "preflight", cell.name)


@pytest.fixture(scope="module")
def run(cell: Path, preflight: Outcome) -> Outcome:
    assert preflight.code == 0, preflight.err
    return run_command(cell.parent, "run", cell.name, "--unattended", "--mode", "optimise", "--json")


def test_preflight_refuses_nothing(preflight: Outcome) -> None:
    assert preflight.code == 0, preflight.err
    assert "That is too little" not in preflight.out


def test_a_run_without_a_person_passes_and_writes(run: Outcome) -> None:
    assert run.code == 0, run.err
    assert run.document["verdict"] == "pass"
    assert "written to the controller" in run.err
