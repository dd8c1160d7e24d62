"""A quick cell, whose runs have processes of their own, and places for their sockets."""

from pathlib import Path

import pytest

from hexacell import api
from tests.cli.cell_folder import BY_HAND, PATIENT, QUICK, copy_cell


@pytest.fixture
def cell(tmp_path: Path, tmp_path_factory, monkeypatch) -> api.Cell:
    """It is calibrated in seconds; a person places the gauges."""
    runtime = tmp_path_factory.mktemp("r")  # the path of a socket must be short
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.setenv("TMPDIR", str(runtime))
    folder = copy_cell(tmp_path)
    folder.edit(*QUICK, *PATIENT, BY_HAND)
    return api.load_cell(str(folder.cell))
