"""``identify`` in ``[identification]``: all, or the zeros of the encoders alone."""

from pathlib import Path

import pytest

from hexacell.cell.loader import describe, load_cell
from hexacell.errors import FileError
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.robot.model import robot_of


@pytest.fixture
def cell_with(copied):
    """A Gough-Stewart platform's cell with these lines in [identification]."""
    return lambda lines: copied("gough-stewart", ("[identification]\n", f"[identification]\n{lines}\n"))


@pytest.mark.parametrize(
    ("lines", "choice"),
    [
        ('identify = "zeros"', ParameterChoice.ZEROS),
        ("", ParameterChoice.ALL),
        ('identify = "all"', ParameterChoice.ALL),
        ('identify = ["zeros"]', ParameterChoice.ZEROS),
    ],
)
def test_the_robot_knows_what_is_identified(
    cell_with, tmp_path: Path, lines: str, choice: ParameterChoice
) -> None:
    cell = load_cell(cell_with(lines))
    assert robot_of(cell).identifies is choice
    (tmp_path / "again.toml").write_text(describe(cell))
    assert load_cell(tmp_path / "again.toml").settings == cell.settings


@pytest.mark.parametrize("lines", ['identify = ["rails"]', "identify = []", 'identify = ["zeros", "all"]'])
def test_another_choice_is_refused_with_its_line(cell_with, lines: str) -> None:
    with pytest.raises(FileError) as refused:
        load_cell(cell_with(lines))
    assert "identify" in str(refused.value)


def test_a_provisional_geometry_has_all_parameters(cell_with) -> None:
    lines = 'identify = ["zeros"]\nprovisional = true'
    with pytest.raises(FileError, match="a provisional geometry has all parameters"):
        load_cell(cell_with(lines))
