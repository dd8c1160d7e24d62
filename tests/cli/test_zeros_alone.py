"""A cell that identifies the zeros of its encoders alone: on the wire, in every text, and honestly."""

import json
import re
from pathlib import Path

import pytest

from hexacell.config.toml_format import native_layout
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS
from tests.cli.cell_folder import CONFIGS
from tests.cli.commands import run_command

NAME = "gough-stewart"
pytestmark = pytest.mark.slow


def cell_in(folder: Path) -> Path:
    """The bundled cell with few poses a point, of a machine that is as drawn but for its offsets."""
    text = (CONFIGS / f"{NAME}.toml").read_text()
    nominal = re.search(r"^base = .*?(?=^# Lengths)", text, re.DOTALL | re.MULTILINE)
    assert nominal is not None
    begin = text.rindex("[simulation.geometry]\n") + len("[simulation.geometry]\n")
    text = text[:begin] + nominal.group() + text[text.index("offset = [599") :]
    for old, new in (
        ("[identification]\n", '[identification]\nidentify = ["zeros"]\n'),
        ("orientations = 17", "orientations = 4"),
        ("largest_change_mm = 15.0", "largest_change_mm = 99.0"),
        ("base_mm = 2.0", "base_mm = 0.01"),
        ("platform_mm = 2.0", "platform_mm = 0.01"),
    ):
        assert old in text
        text = text.replace(old, new)
    (folder / f"{NAME}.toml").write_text(text)
    config = f"{NAME}.controller.toml"
    (folder / config).write_text((CONFIGS / config).read_text())
    return folder / f"{NAME}.toml"


def test_the_zeros_of_a_machine_that_is_as_drawn_are_written_and_pass(tmp_path: Path) -> None:
    cell = cell_in(tmp_path)
    config = tmp_path / f"{NAME}.controller.toml"
    before = native_layout(GOUGH_STEWART_PARAMETERS).read(config).geometry
    run = run_command(tmp_path, "run", cell, "--unattended", "--mode", "optimise", "--json")
    assert run.code == 0, run.err
    assert run.document["line"].startswith("zeros only, 6 of 33 parameters, 20 records at 5 points")
    assert run.document["line"].endswith("(limit 0.3): pass")
    after = native_layout(GOUGH_STEWART_PARAMETERS).read(config).geometry
    for symbol in ("base", "platform"):
        assert (after[symbol] == before[symbol]).all()
    built = [599.478, 598.015, 601.32, 598.618, 599.07, 601.521]
    assert after["offset"] == pytest.approx(built, abs=0.2)
    [folder] = (tmp_path / "runs" / NAME).glob("2*")
    result = json.loads((folder / "result.json").read_text())
    assert result["identifies"] == "zeros"
    report = run_command(tmp_path, "report", folder)
    assert report.code == 0, report.err
    assert "zeros alone" in " ".join((folder / "report.html").read_text().split())
