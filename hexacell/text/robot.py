"""The robot of a cell or a run: in a picture, or as a page to turn, one file without network."""

from collections.abc import Iterable, Iterator
from html import escape
from itertools import groupby
from typing import Any

import numpy as np

from hexacell.drawing.robot_scene import base_shapes, moved_shapes, robot_scene
from hexacell.drawing.shapes import COLOURS, Form, Role, Shape, arrows, enlargement
from hexacell.drawing.svg import SOLID, svg_of
from hexacell.errors import UsageError
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.services.robot_view import RobotView

MOST_POSES = 40
"""More poses make the page slow, and are left out."""

LONGEST_CHANGE = 0.5
"""The largest change of a joint is drawn this share of the robot's size long, at most."""

EYE = {"x": 0.95, "y": -1.85, "z": 0.7}
THIN = 2.0
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Nothing comes from elsewhere, even if a later plotly wants it."""

WORDS = {Role.BEFORE: "as found (brown)", Role.AFTER: "as left (blue)"}


def robot_picture(view: RobotView) -> tuple[str, str]:
    """The robot at its first pose with the errors of held-out poses, as SVG; and that in words."""
    pose = view.poses[0]
    shown = [one for one in view.measured if one.name != "records"] or view.measured
    scene = robot_scene(view.robot, pose)
    caption = f"The robot at {pose}: its legs, the ball between its gauges x, y and z, the base frame."
    if shown:
        factor = enlargement((one.vectors for one in shown), view.robot.size(pose))
        for one in shown:
            scene += arrows(one.role, one.planned, factor * one.vectors)
        sides = " and ".join(
            f"{WORDS[one.role]}, up to {np.linalg.norm(one.vectors, axis=-1).max():.3f} mm" for one in shown
        )
        caption += f" Arrows: where the ball was instead, {factor:g} times as far: {sides}."
    return svg_of(scene, view.title, caption), caption


def page_of(view: RobotView) -> str:
    """The page, with errors and changes enlarged; raises ``UsageError`` where plotly is not installed."""
    try:
        from plotly import graph_objects, io  # noqa: PLC0415 - an optional package
    except ImportError as error:
        raise UsageError(
            "the page needs the package plotly",
            action="Install hexacell[view], or name a file that ends in .svg",
        ) from error
    poses = view.poses[:MOST_POSES]
    still = [*_traces(base_shapes(view.robot, poses[0])), *_measured(view)]
    moved = [[*_traces(moved_shapes(view.robot, pose)), *_change(view, pose)] for pose in poses]
    places = list(range(len(still), len(still) + len(moved[0])))
    titles = [{"title": {"text": f"{escape(view.title)}: the robot at {pose}"}} for pose in poses]
    names = [str(number) for number in range(1, len(poses) + 1)]
    frames = [
        {"name": name, "data": data, "traces": places, "layout": title}
        for name, data, title in zip(names, moved, titles, strict=True)
    ]
    body = io.to_html(
        graph_objects.Figure(data=[*still, *moved[0]], frames=frames, layout=_layout(names) | titles[0]),
        config={"displaylogo": False, "responsive": True},
        full_html=False,
        include_plotlyjs=True,
        auto_play=False,
        div_id="robot",
        default_height="100vh",
    )
    policy = f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{POLICY}">'
    head = f"<head>{policy}<title>{escape(view.title)}: the robot</title></head>"
    return f'<!DOCTYPE html>\n<html lang="en">{head}\n<body style="margin:0">{body}</body></html>\n'


def _layout(names: Iterable[str]) -> dict[str, Any]:
    at_once = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate", "transition": {"duration": 0}}
    steps = [{"label": name, "method": "animate", "args": [[name], at_once]} for name in names]
    axes = {f"{axis}axis": {"title": {"text": f"{axis}, mm"}} for axis in "xyz"}
    return {
        "template": "plotly_white",
        "scene": {"aspectmode": "data", "camera": {"eye": EYE}, **axes},
        "sliders": [{"steps": steps, "currentvalue": {"prefix": "pose "}}],
        "legend": {"x": 1.0, "xanchor": "right", "bgcolor": "rgba(255, 255, 255, 0.7)"},
        "margin": {"l": 10, "r": 10, "b": 10, "t": 60},
    }


def _change(view: RobotView, pose: Pose) -> Iterator[dict[str, Any]]:
    """The legs before, whose joints are as far from the present ones as their differences, enlarged."""
    if view.before is None:
        return
    joints = view.robot.joints(pose)
    now, then = (
        np.stack([legs.base_joints[0], legs.platform_joints[0]], axis=1)
        for legs in (robot.legs(pose, joints) for robot in (view.robot, view.before))
    )
    factor = enlargement([(then - now).reshape(-1, 3)], LONGEST_CHANGE * view.robot.size(pose))
    legs = [Shape(Form.LINE, Role.BEFORE, ends) for ends in now + factor * (then - now)]
    yield from _traces(legs, f"legs as found, differences {factor:g} times as large")


def _measured(view: RobotView) -> Iterator[dict[str, Any]]:
    """Planned places of the ball, and from there to the measured ones; all at one enlargement."""
    factor = enlargement((one.vectors for one in view.measured), view.robot.size(view.poses[0]))
    for one in view.measured:
        name = f"{one.name}: {len(one.planned)}, errors {factor:g} times as large"
        yield from _traces(arrows(one.role, one.planned, factor * one.vectors), name)
    places = {tuple(place) for one in view.measured for place in one.planned.tolist()}
    planned = [Shape(Form.BALL, Role.BASE, np.array([place])) for place in sorted(places)]
    yield from _traces(planned, "where the ball was to be")


def _traces(shapes: Iterable[Shape], name: str = "") -> Iterator[dict[str, Any]]:
    """Shapes as traces: those of a form, a role and a width in one."""
    for (form, role, size), some in groupby(sorted(shapes, key=_kind), key=_kind):
        alike = list(some)
        ends = [one.points for one in alike]
        look = {"name": name or role, "showlegend": bool(name), "hoverinfo": "name"}
        match form:
            case Form.SURFACE:
                yield from (_surface(corners, role) | look for corners in ends)
            case Form.WORD:
                font = {"size": 17, "color": "#111111" if role is Role.LEG else COLOURS[role]}
                words = {"mode": "text", "text": [one.text for one in alike], "textfont": font}
                yield _places([place[:1] for place in ends]) | words | look
            case Form.BALL:
                marker = {"size": 9 if role is Role.BALL else 4, "color": COLOURS[role]}
                yield _places(ends) | {"mode": "markers", "marker": marker} | look
            case _:
                line = {"width": size * 1.5 * SOLID.get(role, THIN), "color": COLOURS[role]}
                yield (
                    _places([np.vstack([one, np.full(3, np.nan)]) for one in ends])
                    | {
                        "mode": "lines+markers" if form is Form.ARROW else "lines",
                        "line": line,
                        "marker": {"size": [0, 5, 0] * len(ends), "color": COLOURS[role]},
                    }
                    | look
                )


def _kind(shape: Shape) -> tuple[Form, Role, float]:
    return shape.form, shape.role, 1.0 if shape.form is Form.BALL else shape.size


def _places(parts: list[Array]) -> dict[str, Any]:
    x, y, z = np.round(np.concatenate(parts), 3).T.tolist()
    return {"type": "scatter3d", "x": x, "y": y, "z": z}


def _surface(corners: Array, role: Role) -> dict[str, Any]:
    """A surface as triangles about its first corner."""
    second = np.arange(1, len(corners) - 1)
    triangles = {"i": [0] * len(second), "j": second.tolist(), "k": (second + 1).tolist()}
    look = {"type": "mesh3d", "color": COLOURS[role], "opacity": 0.15 if role is Role.BASE else 0.5}
    return _places([corners]) | triangles | look
