"""Pictures of the how-tos: what commands print, and errors beside limits, is as the program has it now."""

import io
import os
import re
import shutil
from pathlib import Path

import pytest
from rich.console import Console
from rich.text import Text

from hexacell.cell.loader import load_cell
from hexacell.measurements.csv_file import write_measurements
from hexacell.measurements.records import MeasurementSet
from hexacell.text.report.charts import error_card
from hexacell.uncertainty.statement import LargestError
from hexacell.verdict.decision import JudgedError
from tests.docs.pages import ROOT, Block, typed, without_figures
from tests.hexacell.services.recorded_nights import Nights
from tests.screen.conftest import UPDATE, compare_with_kept, without_fonts

TYPED = {
    "typed-preflight": ["hexacell preflight my-robot.toml"],
    "typed-next": ["hexacell next my-robot.toml --measurements records.csv"],
    "typed-notify": [
        "hexacell notify my-robot.toml",
        "hexacell status my-robot.toml --metrics my-robot.prom",
        "grep -v -e '^#' -e ratio my-robot.prom",
    ],
    "typed-nights": ["hexacell status my-robot.toml", "hexacell history my-robot.toml --drift"],
}
RUN = {"typed-demo": ["hexacell demo"]}
"""Its noise differs each time: made anew, never compared."""

CARDS = {
    "cards-check": (
        ("The check ends: still accurate", 0.014, 0.089, 0.15),
        ("The check goes on", 0.101, 0.062, 0.15),
        ("The check goes on", 0.190, 0.080, 0.15),
        ("The check ends: calibrate", 0.312, 0.090, 0.15),
    ),
    "cards-scatter": (
        ("At the task, with the scatter of one visit", 0.020, 0.966, 0.3),
        ("Of that by the geometry", 0.020, 0.079, 0.3),
    ),
}
"""What an error is called, the error, its U and its limit, mm."""

PORTS = {
    "[controller]": "port = 5907",
    "[encoders]": 'bus = { interface = "slcan", channel = "/dev/ttyACM7" }',
    'name = "x"\naxis': 'port = "/dev/ttyUSB7"',
    'name = "y"\naxis': 'port = "/dev/ttyUSB8"',
    'name = "z"\naxis': 'port = "/dev/serial/by-id/usb-FTDI_FT232R_A10K1-if00-port0"',
}
NOTIFICATIONS = """
[[notifications]]
name = "office"
url = "mailto://mail.example?from=cell@example&to=office@example"

[[notifications]]
name = "board"
url = "mqtts://broker.example"
on = ["pass", "no-pass", "alarm", "answer-needed", "failure"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cell without its devices, after thirteen nights in which leg 4 moved once; a first few records."""
    folder = tmp_path_factory.mktemp("typed")
    for path in (ROOT / "configs").glob("simulated-hexaglide.*"):
        shutil.copy(path, folder)
    text = (folder / "simulated-hexaglide.toml").read_text().partition("\n[simulation]")[0]
    text = text.replace('name = "simulated-hexaglide"', 'name = "my-robot"')
    for place, line in PORTS.items():
        text = text.replace(place, f"{line}\n{place}" if "=" in place else f"{place}\n{line}")
    (folder / "my-robot.toml").write_text(text + NOTIFICATIONS)
    nights = Nights(load_cell(folder / "my-robot.toml"))
    nights.calibrate()
    for number in range(12):
        nights.changes = {"l4": 0.3} if number > 6 else {}
        nights.check()
    first = MeasurementSet(nights.measured(1, [(0, 0, 0), (2, 1, 0), (-1, 2, 1), (1, -2, -1)]))
    write_measurements(folder / "records.csv", first)
    return folder


@pytest.mark.parametrize("name", [*TYPED, *(RUN if UPDATE in os.environ else ())])
def test_the_kept_picture_shows_what_a_command_prints(name: str, folder: Path) -> None:
    blocks = [Block((command,), fails=False) for command in (TYPED | RUN)[name]]
    console = Console(record=True, width=100, file=io.StringIO(), highlight=False)
    for block, (_, printed) in zip(blocks, typed(blocks, folder), strict=True):
        console.print(Text(f"$ {block.commands[0]}", "bold"), Text(printed.rstrip()), sep="\n")
    picture = without_fonts(console.export_svg(title="", unique_id="terminal"))
    kept = ROOT / "docs" / f"{name}.svg"
    if UPDATE in os.environ:
        kept.write_text(picture)
    # The last digits of figures differ between processors.
    now, before = (re.sub(r"[+-]#", "#", without_figures(one)) for one in (picture, kept.read_text()))
    assert now == before


@pytest.mark.parametrize("name", CARDS)
def test_the_kept_cards_are_as_reports_have_them(name: str) -> None:
    drawn = ""
    for number, (title, *error, limit) in enumerate(CARDS[name]):
        card = error_card(title, JudgedError.of(LargestError(*error), limit, 1.5), "mm").svg
        place = f'x="{328 * (number % 2)}" y="{126 * (number // 2)}" width="320" height="118"'
        drawn += card.replace("<svg ", f"<svg {place} ", 1)
    size = f"648 {126 * len(CARDS[name]) // 2 - 8}"
    picture = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}">\n{drawn}</svg>\n'
    compare_with_kept(ROOT / "docs" / f"{name}.svg", picture)
