"""``identify`` in ``[identification]``: all, or the zeros of the encoders alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from hexacell.cell.loader import describe, load_cell
from hexacell.errors import FileError
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.robot.model import robot_of

CONFIGS = Path(__file__).parents[3] / "configs"


def cell_with(folder: Path, lines: str, name: str = "gough-stewart") -> Path:
    for end in ("toml", "controller.toml"):
        (folder / f"{name}.{end}").write_text((CONFIGS / f"{name}.{end}").read_text())
    cell = folder / f"{name}.toml"
    cell.write_text(cell.read_text().replace("[identification]\n", f"[identification]\n{lines}\n"))
    return cell


@pytest.mark.parametrize(
    ("lines", "choice"),
    [
        ('identify = "zeros"', ParameterChoice.ZEROS),
        ("", ParameterChoice.ALL),
        ('identify = "all"', ParameterChoice.ALL),
        ('identify = ["zeros"]', ParameterChoice.ZEROS),
    ],
)
def test_the_robot_knows_what_is_identified(tmp_path: Path, lines: str, choice: ParameterChoice) -> None:
    cell = load_cell(cell_with(tmp_path, lines))
    assert robot_of(cell).identifies is choice
    (tmp_path / "again.toml").write_text(describe(cell))
    assert load_cell(tmp_path / "again.toml").settings == cell.settings


@pytest.mark.parametrize("lines", ['identify = ["rails"]', "identify = []", 'identify = ["zeros", "all"]'])
def test_another_choice_is_refused_with_its_line(tmp_path: Path, lines: str) -> None:
    with pytest.raises(FileError) as refused:
        load_cell(cell_with(tmp_path, lines))
    assert "identify" in str(refused.value)


def test_a_provisional_geometry_has_all_parameters(tmp_path: Path) -> None:
    lines = 'identify = ["zeros"]\nprovisional = true'
    with pytest.raises(FileError, match="a provisional geometry has all parameters"):
        load_cell(cell_with(tmp_path, lines))
