"""A scene as SVG text: one set of colours for light and dark pages, no fonts of its own."""

from collections.abc import Iterator
from html import escape

import numpy as np

from hexacell.drawing.camera import Camera
from hexacell.drawing.shapes import COLOURS, Form, Role, Scene, Shape
from hexacell.kinematics.rotations import Array

WIDTH, HEIGHT, MARGIN = 640, 420, 36
"""Within which it is as large as possible; of the height what stays free is cut off, but for the margin."""

SOLID = {Role.RAIL: 5.0, Role.DRIVE: 6.0, Role.LEG: 6.0, Role.PLATFORM: 5.0}
THIN = {Role.BASE: 1.5}
WIDTH_OF_OTHERS = 2.2
"""Of lines, in units of the picture; those of what is solid have an edge."""

EDGE = "#3c4855"
"""It sets off what is solid from the like; on black it is not seen."""

ANCHORS = {0: "middle", 1: "start", -1: "end"}
SHORTEST = 4.0
"""A vector that is drawn shorter than that is a dot: a head would be longer than it."""


def svg_of(scene: Scene, title: str, description: str) -> str:
    """The picture, the same byte for byte each time; its title and description are read out."""
    camera = Camera.fitted(scene, (WIDTH, HEIGHT), MARGIN)
    shown = np.concatenate([camera.places(shape.points) for shape in scene])[:, 1]
    top, height = shown.min() - MARGIN, np.ptp(shown) + 2.0 * MARGIN
    size = f'width="{WIDTH}" height="{height:.0f}" viewBox="0 {top:.0f} {WIDTH} {height:.0f}"'
    style = 'stroke-linecap="round" stroke-linejoin="round" font-family="sans-serif" font-weight="bold"'
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" role="img" {size} {style}>',
            f"<title>{escape(title)}</title>",
            f"<desc>{escape(description)}</desc>",
            *(line for shape in camera.back_to_front(scene) for line in _drawn(shape, camera)),
            "</svg>\n",
        )
    )


def _drawn(shape: Shape, camera: Camera) -> Iterator[str]:
    places, colour = camera.places(shape.points), COLOURS[shape.role]
    x, y = places[0].tolist()
    match shape.form:
        case Form.LINE:
            yield from _line(shape, places, colour)
        case Form.ARROW:
            yield from _arrow(places[0], places[1], colour)
        case Form.SURFACE:
            paint = f'fill="{colour}" fill-opacity="{0.16 if shape.role is Role.BASE else 0.55}"'
            yield f'<path d="{_path(places)}Z" {paint} stroke="{colour}" stroke-width="1.5"/>'
        case Form.BALL:
            radius = max(2.0, shape.size * camera.scale)
            yield _circle(x, y, radius, f'fill="{colour}" stroke="{EDGE}"')
            if shape.role is Role.BALL:  # light that makes it round
                light, paint = 0.35 * radius, 'fill="#fff" fill-opacity="0.7"'
                yield _circle(x - light, y - light, 0.3 * radius, paint)
        case Form.WORD:
            if shape.role is Role.LEG:
                colour = "#fff"
                yield _circle(x, y, 9.0, f'fill="{EDGE}" stroke="#fff" stroke-width="1.2"')
            where = f'x="{x:.1f}" y="{y + 4.5:.1f}" text-anchor="{ANCHORS[camera.side(shape)]}"'
            yield f'<text {where} font-size="13" fill="{colour}">{escape(shape.text)}</text>'


def _line(shape: Shape, places: Array, colour: str) -> Iterator[str]:
    width = shape.size * (SOLID | THIN).get(shape.role, WIDTH_OF_OTHERS)
    end = ' stroke-linecap="butt"' if shape.size > 1.0 else ""
    edged = ((EDGE, width + 1.6), (colour, width)) if shape.role in SOLID else ((colour, width),)
    for paint, broad in edged:
        yield f'<path d="{_path(places)}" fill="none" stroke="{paint}" stroke-width="{broad:.1f}"{end}/>'


def _arrow(start: Array, end: Array, colour: str) -> Iterator[str]:
    if (length := float(np.linalg.norm(end - start))) < SHORTEST:
        yield _circle(end[0], end[1], SHORTEST / 2.0, f'fill="{colour}"')
        return
    neck = end - min(9.0, 0.6 * length) * (end - start) / length
    across = 0.45 * (end - neck)[::-1] * (-1.0, 1.0)
    yield f'<path d="{_path(np.stack([neck + across, end, neck - across]))}Z" fill="{colour}"/>'
    yield f'<path d="{_path(np.stack([start, neck]))}" stroke="{colour}" stroke-width="{WIDTH_OF_OTHERS}"/>'


def _path(places: Array) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)


def _circle(x: float, y: float, radius: float, paint: str) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" {paint}/>'
