"""A scene as SVG text: one set of colours for light and dark pages, no fonts of its own."""

from collections.abc import Iterator
from html import escape

import numpy as np

from hexacell.drawing.camera import DIRECTION_DEG, Camera
from hexacell.drawing.shapes import COLOURS, Ball, Label, Line, Role, Scene, Shape, Surface
from hexacell.kinematics.rotations import Array

WIDTH, HEIGHT, MARGIN = 640, 420, 36
"""Within which it is as large as possible; of the height what stays free is cut off, but for the margin."""

WIDTHS = {Role.RAIL: 5.0, Role.DRIVE: 6.0, Role.LEG: 6.0, Role.PLATFORM: 5.0, Role.BASE: 1.5}
"""Of lines, in units of the picture; those of all other roles are ``THIN``."""
THIN = 2.2

EDGE = "#3c4855"
"""The edges of what is solid, by which it stands out before the like; on black they are not seen."""

ANCHORS = {0: "middle", 1: "start", -1: "end"}
SOLID = {Role.RAIL, Role.DRIVE, Role.LEG, Role.PLATFORM}
SHORTEST = 4.0
"""A vector that is drawn shorter than that is a dot: a head would be longer than it."""


def svg_of(
    scene: Scene, title: str, description: str, direction_deg: tuple[float, float] = DIRECTION_DEG
) -> str:
    """The picture, the same byte for byte each time; its title and description are read out."""
    camera = Camera.fitted(scene, (WIDTH, HEIGHT), MARGIN, direction_deg)
    shown = camera.places(scene.points)
    top, height = shown[:, 1].min() - MARGIN, np.ptp(shown[:, 1]) + 2.0 * MARGIN
    return "\n".join(
        (
            '<svg xmlns="http://www.w3.org/2000/svg" role="img"',
            f'  width="{WIDTH}" height="{height:.0f}"',
            f'  viewBox="0 {top:.0f} {WIDTH} {height:.0f}"',
            '  stroke-linecap="round" stroke-linejoin="round" font-family="sans-serif" font-weight="bold">',
            f"<title>{escape(title)}</title>",
            f"<desc>{escape(description)}</desc>",
            *(line for shape in camera.back_to_front(scene) for line in _drawn(shape, camera)),
            "</svg>\n",
        )
    )


def _drawn(shape: Shape, camera: Camera) -> Iterator[str]:
    places, colour = camera.places(shape.points), COLOURS[shape.role]
    match shape:
        case Line():
            yield from _line(shape, places, colour)
        case Surface():
            opacity = 0.16 if shape.role is Role.BASE else 0.55
            edge = f'stroke="{colour}" stroke-width="1.5"'
            yield f'<path d="{_path(places)}Z" fill="{colour}" fill-opacity="{opacity}" {edge}/>'
        case Ball():
            (x, y), radius = places[0], max(2.0, shape.radius * camera.scale)
            yield _circle(x, y, radius, f'fill="{colour}" stroke="{EDGE}"')
            if shape.role is Role.BALL:  # light that makes it round
                yield _circle(
                    x - 0.35 * radius, y - 0.35 * radius, 0.3 * radius, 'fill="#fff" fill-opacity="0.7"'
                )
        case Label():
            x, y = places[0]
            yield from _word(shape, x, y, ANCHORS[camera.side(shape)], colour)


def _word(label: Label, x: float, y: float, anchor: str, colour: str) -> Iterator[str]:
    if label.role is Role.LEG:
        yield _circle(x, y, 9.0, f'fill="{EDGE}" stroke="#fff" stroke-width="1.2"')
        colour = "#fff"
    where = f'x="{x:.1f}" y="{y + 4.5:.1f}" text-anchor="{anchor}"'
    yield f'<text {where} font-size="13" fill="{colour}">{escape(label.text)}</text>'


def _line(line: Line, places: Array, colour: str) -> Iterator[str]:
    width = line.weight * WIDTHS.get(line.role, THIN)
    if line.has_head:
        start, end = places
        length = float(np.linalg.norm(end - start))
        if length < SHORTEST:
            yield _circle(end[0], end[1], SHORTEST / 2.0, f'fill="{colour}"')
            return
        along = (end - start) / length
        neck = end - min(9.0, 0.6 * length) * along
        across = 0.45 * (end - neck)[::-1] * (-1.0, 1.0)
        yield f'<path d="{_path(np.stack([neck + across, end, neck - across]))}Z" fill="{colour}"/>'
        places = np.stack([start, neck])
    path, butt = _path(places), ' stroke-linecap="butt"' if line.weight > 1.0 else ""
    if line.role in SOLID:
        yield f'<path d="{path}" fill="none" stroke="{EDGE}" stroke-width="{width + 1.6:.1f}"{butt}/>'
    yield f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{width:.1f}"{butt}/>'


def _path(places: Array) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)


def _circle(x: float, y: float, radius: float, paint: str) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" {paint}/>'
