"""The picture of what a minute buys: U by the minutes of a whole calibration, for each bundled mechanism.

``python -m docs.minutes`` draws it, as ``make figures`` does.
"""

from pathlib import Path

from hexacell.campaign.planner import Plan
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.dry_run.campaign import dry_run
from hexacell.robot.model import robot_of
from hexacell.text.svg_drawing import AFTER, BEFORE, INK, as_svg, columns, new_figure, plain_ticks

CELLS = {
    "simulated-hexaglide": (AFTER, "-"),
    "gough-stewart": (BEFORE, "-"),
    "linapod": (INK, "-"),
    "rotary-cranks": (INK, "--"),
}
PICTURE = Path(__file__).with_name("minutes.svg")
LARGEST_MM = 2.0
"""Above it nothing is shown: the geometry is hardly identified."""


def main() -> None:
    """Draw it."""
    figure, [axes] = new_figure((7.0, 3.2), (0.10, 0.16, 0.86, 0.78))
    for name, (colour, line) in CELLS.items():
        cell = load_cell(bundled_config(name))
        result = dry_run(Plan(cell.settings, robot_of(cell)))
        shown = [(minutes, size) for minutes, size in result.course if size <= LARGEST_MM]
        axes.semilogy(*columns(shown), line, color=colour, label=name)
    plain_ticks(axes.yaxis)
    axes.set_xlabel("minutes of a whole calibration, held-out poses included")
    axes.set_ylabel("U at the task, mm")
    axes.legend(frameon=False)
    PICTURE.write_text(as_svg(figure))


if __name__ == "__main__":
    main()
