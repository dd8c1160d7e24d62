"""Draws ``docs/gauges.svg``: robot, ball, gauges, axes and signs, from the program's own robot.

Left is the Hexaglide of ``configs/simulated-hexaglide.toml`` as drawn, to scale, at its first point, its
sliders where the inverse kinematics puts them. Right are the gauges at the ball, and what one shows after
the ball has moved by 1 mm. Both look along y: x goes to the right, z up, y away.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from hexacell.cell.devices import GaugeAxis
from hexacell.cell.loader import load_cell
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.services.offline import robot_of

ROOT: Final = Path(__file__).parents[1]
WIDTH, HEIGHT = 1000, 560
AWAY: Final = np.array([0.42, 0.32])
"""How far one mm along y is to the right and up on the picture."""

COLOURS: Final = {"x": "#c0392b", "y": "#1e8449", "z": "#1f5fa8"}
DARK, STEEL, PALE = "#1b2631", "#566573", "#bdc3c7"
UNITS: Final = dict(zip("xyz", np.eye(3), strict=True))
RAILS: Final = (155.0, 0.0, -155.0)
FROM_BACK_TO_FRONT: Final = (2, 3, 1, 4, 0, 5)


class View:
    """A part of the picture: an origin, a scale, and the shapes so far."""

    def __init__(self, left: float, down: float, scale: float) -> None:
        self.origin, self.scale = np.array([left, down]), scale
        self.shapes: list[str] = []

    def at(self, place: Array) -> Array:
        """Where a place (3,) in the base frame is on the picture."""
        x, y, z = place
        across, up = np.array([x, z]) + AWAY * y
        return self.origin + self.scale * np.array([across, -up])

    def line(self, start: Array, end: Array, colour: str, width: float, more: str = "") -> None:
        """A straight line."""
        (a, b), (c, d) = self.at(start), self.at(end)
        self.shapes.append(
            f'<line x1="{a:.1f}" y1="{b:.1f}" x2="{c:.1f}" y2="{d:.1f}" stroke="{colour}" '
            f'stroke-width="{width:g}" stroke-linecap="round"{more}/>'
        )

    def arrow(self, start: Array, end: Array, axis: str) -> None:
        """An arrow along an axis."""
        self.line(start, end, COLOURS[axis], 2.5, f' marker-end="url(#to-{axis})"')

    def outline(self, places: Array, fill: str, stroke: str) -> None:
        """A closed shape."""
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self.at, places))
        self.shapes.append(
            f'<polygon points="{points}" fill="{fill}" stroke="{stroke}" stroke-width="1.5" '
            'stroke-linejoin="round"/>'
        )

    def disc(self, place: Array, radius: float, fill: str) -> None:
        """A ball, or a joint."""
        x, y = self.at(place)
        self.shapes.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{fill}" stroke="{DARK}"/>'
        )

    def words(
        self, place: Array, text: str, across: float = 0.0, down: float = 0.0, more: str = ""
    ) -> None:
        """Words beside a place."""
        x, y = self.at(place)
        self.shapes.append(f'<text x="{x + across:.1f}" y="{y + down:.1f}"{more}>{text}</text>')


def robot() -> View:
    """The whole machine with its base frame."""
    cell = load_cell(ROOT / "configs" / "simulated-hexaglide.toml")
    known = robot_of(cell)
    ball = np.array(cell.settings.identification.points[0])
    pose = PoseBatch.of([Pose(*ball)])
    joints = Hexaglide().inverse(known.drawing, known.branch, pose)[0]
    sliders = known.drawing["S"] + joints[:, None] * UNITS["x"]
    platform = ball + known.drawing["B"]

    view = View(250, 450, 0.40)
    for y in RAILS:
        view.line(np.array([-540.0, y, 0.0]), np.array([540.0, y, 0.0]), PALE, 6)
    for leg in FROM_BACK_TO_FRONT:
        view.line(sliders[leg], platform[leg], STEEL, 4)
    view.outline(platform, "#d6eaf8", STEEL)
    for leg in FROM_BACK_TO_FRONT:
        view.disc(platform[leg], 4, "white")
        view.disc(sliders[leg], 9, "#fdebd0")
        view.words(sliders[leg], str(leg + 1), 0, 4.5, ' text-anchor="middle" class="small"')
    view.line(platform.mean(axis=0), ball, STEEL, 5)
    view.disc(ball, 8, "#f7dc6f")
    view.words(ball, "ball: origin of the platform frame,", 14, -10)
    view.words(ball, "at x y z of a pose", 14, 8)
    for axis, unit in UNITS.items():
        view.arrow(np.zeros(3), 130 * unit, axis)
        view.words(130 * unit, f"+{axis}", 8, -4, f' class="axis" fill="{COLOURS[axis]}"')
    for row, line in enumerate(
        ("rails along x; sliders 1 to 3 on the -x side", "of their platform joints, 4 to 6 on the +x side")
    ):
        view.shapes.append(f'<text x="30" y="{HEIGHT - 45 + 18 * row}">{line}</text>')
    return view


def gauges() -> View:
    """The ball with the three gauges around it."""
    view = View(670, 300, 1.1)
    ball = 26.0
    view.line(np.array([0.0, 0.0, -90.0]), np.zeros(3), STEEL, 12)
    for axis in "yxz":
        _gauge(view, axis, ball)
        if axis == "y":
            view.disc(np.zeros(3), ball, "#f7dc6f")
    shown = GaugeAxis(0, 1).reading(1.0), GaugeAxis(0, -1).reading(1.0)
    lines = [
        ("The ball moves by 1 mm along +x. A gauge that", ""),
        ("counts up when its plunger is pushed in,", ""),
        (f"on the +x side is pushed in, shows {shown[0]:+.3f}:", "sign = 1"),
        (f"on the -x side is let out, shows {shown[1]:+.3f}:", "sign = -1"),
        ("y and z likewise. Deviation = sign * (reading - zero)", ""),
    ]
    for row, (words, sign) in enumerate(lines):
        down = HEIGHT - 118 + 22 * row
        view.shapes.append(f'<text x="560" y="{down}">{words}</text>')
        view.shapes.append(f'<text x="880" y="{down}" class="code">{sign}</text>')
    return view


def _gauge(view: View, axis: str, ball: float) -> None:
    """A gauge on the + side of its axis: flat plate at the ball, plunger, body, and the axis' arrow."""
    unit, others = UNITS[axis], [UNITS[one] for one in "xyz" if one != axis]
    long = 1.7 if axis == "y" else 1.0  # the projection shortens what is along y
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    half = 20.0 if axis != "y" else 16.0
    plate = np.array([ball * unit + half * (a * others[0] + b * others[1]) for a, b in square])
    view.outline(plate, "#eaeded", DARK)
    view.line(ball * unit, (ball + 48 * long) * unit, STEEL, 5)
    view.line((ball + 48 * long) * unit, (ball + 100 * long) * unit, COLOURS[axis], 20, ' opacity="0.85"')
    end = (ball + 112 * long) * unit
    view.arrow(end, end + 36 * long * unit, axis)
    across, down = {"x": (-6, -22), "y": (30, 14), "z": (16, 20)}[axis]
    view.words(end, f"{axis} gauge", across, down, f' class="axis" fill="{COLOURS[axis]}"')
    tip = end + 36 * long * unit
    view.words(tip, f"+{axis}", 16, 5, f' class="axis" fill="{COLOURS[axis]}"')


def picture() -> str:
    """The whole picture as SVG."""
    markers = "".join(
        f'<marker id="to-{axis}" markerWidth="9" markerHeight="8" refX="3" refY="4" orient="auto">'
        f'<path d="M0,0 L9,4 L0,8 z" fill="{colour}"/></marker>'
        for axis, colour in COLOURS.items()
    )
    style = (
        "text{font-family:'DejaVu Sans','Noto Sans',sans-serif;font-size:13.5px}"
        ".small{font-size:12px}.head{font-size:17px;font-weight:bold}.axis{font-weight:bold;fill:inherit}"
        ".code{font-family:'DejaVu Sans Mono',monospace}"
    )
    heads = (
        '<text x="30" y="34" class="head">The robot and its base frame</text>'
        '<text x="560" y="34" class="head">Three gauges at the ball</text>'
        '<text x="30" y="56">A pose is x y z a b c, mm and deg: R = Rz(c) Ry(b) Rx(a)</text>'
        '<text x="560" y="56">flat plates, plungers in the middle of their travel</text>'
        f'<line x1="530" y1="20" x2="530" y2="{HEIGHT - 20}" stroke="{PALE}"/>'
    )
    shapes = "\n".join(robot().shapes + gauges().shapes)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">\n'
        "<title>Robot, ball, gauges, axes and signs</title>\n"
        f"<defs>{markers}<style>{style}</style></defs>\n"
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>\n{heads}\n{shapes}\n</svg>\n'
    )


if __name__ == "__main__":
    (ROOT / "docs" / "gauges.svg").write_text(picture(), encoding="utf-8")
