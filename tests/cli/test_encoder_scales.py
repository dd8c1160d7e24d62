"""Encoders whose scales are off: they are told, written beside the others, and the machine passes."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cli.cell_folder import CONFIGS
from tests.cli.commands import run_command

SCALES = [0.0003, -0.0002, 0.0001, -0.0003, 0.0002, -0.0001]
pytestmark = pytest.mark.slow


def test_scales_are_identified_and_written_on_the_wire(tmp_path: Path) -> None:
    cell, config = (tmp_path / f"linapod.{kind}" for kind in ("toml", "controller.toml"))
    text = (CONFIGS / cell.name).read_text()
    for section, line in (
        ("robot", "encoder_scales = true"),
        ("tolerances", "encoder_scale = 1e-3"),
        ("simulation.geometry", f"encoder_scale = {SCALES}"),
    ):
        text = text.replace(f"[{section}]\n", f"[{section}]\n{line}\n")
    cell.write_text(text)
    before = (CONFIGS / config.name).read_text()
    config.write_text(before.replace("[geometry]\n", f"[geometry]\nencoder_scale = {[0.0] * 6}\n"))
    run = run_command(tmp_path, "run", cell, "--unattended", "--mode", "optimise", "--json")
    assert run.code == 0, run.err
    assert run.document["line"].startswith("51 parameters, 66 records at 6 points")
    assert run.document["line"].endswith("(limit 0.3): pass")
    [folder] = (tmp_path / "runs" / "linapod").glob("2*")
    result = json.loads((folder / "result.json").read_text())
    told, sigma = (np.array(result[key]["encoder_scale"]) for key in ("geometry", "sigma"))
    assert (np.abs(told - SCALES) < 3.0 * sigma).all()
    # What all have in common no record tells.
    np.testing.assert_allclose(told - told.mean(), SCALES, atol=1.5e-4)
    written = tomllib.loads(config.read_text())["geometry"]["encoder_scale"]
    np.testing.assert_allclose(written, told, atol=1e-9)
