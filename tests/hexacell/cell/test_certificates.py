"""Certificates of instruments, and what a report says of the machine, in the cell file."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.errors import FileError

SECTIONS = """
[report]
machine = "Hexaglide HX 3"
serial_number = "0017"
"""


def cell_file(folder: Path, due: str) -> Path:
    text = bundled_config("simulated-hexaglide").read_text()
    certificate = f'certificate = {{number = "D-K 17", due = {due}}}'
    gauge = f'name = "x"\naxis = "x"\nserial_number = "4711"\n{certificate}\n'
    path = folder / "cell.toml"
    path.write_text(text.replace('name = "x"\naxis = "x"\n', gauge, 1) + SECTIONS)
    return path


def test_a_certificate_holds_until_the_day_that_is_stated(tmp_path) -> None:
    settings = load_cell(cell_file(tmp_path, '"2027-03-31"')).settings
    assert settings.certificates["gauge x"].number == "D-K 17"
    assert settings.expired_on(date(2027, 3, 31)) == ()
    assert settings.expired_on(date(2027, 4, 1)) == ("gauge x",)
    assert (settings.report.machine, settings.report.serial_number) == ("Hexaglide HX 3", "0017")


@pytest.mark.parametrize("due", ['"2027-02-30"', '"soon"', '""', '"31.3.2027"', "20270331", "true"])
def test_what_is_no_day_is_refused_with_its_line(tmp_path, due) -> None:
    with pytest.raises(FileError, match="day") as refusal:
        load_cell(cell_file(tmp_path, due))
    assert refusal.value.line is not None
