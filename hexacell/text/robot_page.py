"""The robot as a page to turn: one file without network, with errors and changes enlarged."""

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from itertools import groupby
from typing import Any

import numpy as np

from hexacell.drawing.robot_scene import DrawnRobot, base_shapes, moved_shapes
from hexacell.drawing.shapes import COLOURS, Ball, Label, Line, Role, Shape, Surface, enlargement
from hexacell.errors import UsageError
from hexacell.kinematics.parameters import LEGS
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.services.robot_view import RobotView

MOST_POSES = 40
"""More poses make the page slow, and are left out."""

LONGEST_CHANGE = 0.5
"""The largest change of a joint is drawn this share of the robot's size long, at most."""

WIDTHS = {Role.LEG: 9.0, Role.RAIL: 8.0, Role.DRIVE: 9.0, Role.PLATFORM: 7.0}
THIN = 3.0

VIEWS = {
    "in space": (0.95, -1.85, 0.7),
    "from the front": (0.0, -2.2, 0.0),
    "from the right": (2.2, 0.0, 0.0),
    "from above": (0.0, -0.001, 2.2),
}
"""Where the viewer is, of the buttons."""

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Nothing comes from elsewhere, even if a later plotly wants it."""


def page_of(view: RobotView) -> str:
    """The whole page.

    Raises:
        UsageError: plotly is not installed.
    """
    try:
        from plotly import graph_objects, io  # noqa: PLC0415 - an optional package
    except ImportError as error:
        raise UsageError(
            "the page needs the package plotly",
            action="Install hexacell[view], or name a file that ends in .svg",
        ) from error
    poses = view.poses[:MOST_POSES]
    still = [*_traces(base_shapes(view.robot, poses[0])), *_measured(view)]
    moved = [_at_pose(view, pose) for pose in poses]
    places = list(range(len(still), len(still) + len(moved[0])))
    figure = graph_objects.Figure(
        data=[*still, *moved[0]],
        frames=[
            {"name": str(n), "data": data, "traces": places, "layout": _title(view, pose)}
            for n, (pose, data) in enumerate(zip(poses, moved, strict=True))
        ],
        layout=_layout(view, poses),
    )
    body = io.to_html(
        figure,
        config={"displaylogo": False, "responsive": True},
        full_html=False,
        include_plotlyjs=True,
        auto_play=False,
        div_id="robot",
        default_height="100vh",
    )
    head = f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{POLICY}">'
    title = f"<title>{escape(view.title)}: the robot</title>"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}{title}</head>\n'
        f'<body style="margin:0">{body}</body></html>\n'
    )


def _layout(view: RobotView, poses: Sequence[Pose]) -> dict[str, Any]:
    still = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate", "transition": {"duration": 0}}
    steps = [
        {"label": str(n + 1), "method": "animate", "args": [[str(n)], still]} for n in range(len(poses))
    ]
    buttons = [
        {"label": name, "method": "relayout", "args": [{"scene.camera": _camera(eye)}]}
        for name, eye in VIEWS.items()
    ]
    return _title(view, poses[0]) | {
        "template": "plotly_white",
        "scene": {
            "aspectmode": "data",
            "camera": _camera(VIEWS["in space"]),
            **{f"{axis}axis": {"title": {"text": f"{axis}, mm"}} for axis in "xyz"},
        },
        "sliders": [{"steps": steps, "currentvalue": {"prefix": "pose "}, "pad": {"b": 10}}],
        "updatemenus": [
            {"type": "buttons", "direction": "right", "buttons": buttons, "x": 0.0, "xanchor": "left"}
        ],
        "legend": {"x": 1.0, "xanchor": "right", "bgcolor": "rgba(255, 255, 255, 0.7)"},
        "margin": {"l": 10, "r": 10, "b": 10, "t": 90},
    }


def _title(view: RobotView, pose: Pose) -> dict[str, Any]:
    return {"title": {"text": f"{escape(view.title)}: the robot at {pose}"}}


def _camera(eye: tuple[float, float, float]) -> dict[str, Any]:
    return {"eye": dict(zip("xyz", eye, strict=True))}


def _at_pose(view: RobotView, pose: Pose) -> list[dict[str, Any]]:
    """What changes with the pose; as many traces at each."""
    traces = list(_traces(moved_shapes(view.robot, pose)))
    if view.before is not None:
        traces.append(_change(view.robot, view.before, pose))
    return traces


def _change(robot: DrawnRobot, before: DrawnRobot, pose: Pose) -> dict[str, Any]:
    """The legs before, whose joints are as far from the present ones as their differences, enlarged."""
    joints = robot.joints(pose)
    now, then = (one.legs(pose, joints) for one in (robot, before))
    ends = np.stack([now.base_joints[0], now.platform_joints[0]], axis=1)
    moved = np.stack([then.base_joints[0], then.platform_joints[0]], axis=1) - ends
    factor = enlargement([moved.reshape(-1, 3)], LONGEST_CHANGE * robot.size(pose))
    name = f"legs as found, differences {factor:g} times as large"
    words = [f"leg {leg + 1} as found" for leg in range(LEGS)]
    return _lines(ends + factor * moved, Role.BEFORE, name, THIN, words)


def _measured(view: RobotView) -> Iterator[dict[str, Any]]:
    """Planned places of the ball, and from there to the measured ones; all at one enlargement."""
    if not view.measured:
        return
    factor = enlargement((one.vectors for one in view.measured), view.robot.size(view.poses[0]))
    for one in view.measured:
        pairs = np.stack([one.planned, one.planned + factor * one.vectors], axis=1)
        words = [f"{np.linalg.norm(vector):.3f} mm off" for vector in one.vectors]
        name = f"{one.name}: {len(pairs)}, errors {factor:g} times as large"
        ends = {"size": [0, 5, 0] * len(pairs), "color": COLOURS[one.role]}
        yield _lines(pairs, one.role, name, THIN, words) | {"mode": "lines+markers", "marker": ends}
    planned = np.unique(np.concatenate([one.planned for one in view.measured]), axis=0)
    marker = {"size": 4, "color": COLOURS[Role.BASE], "symbol": "x"}
    yield _scatter(planned, "markers", "where the ball was to be", marker=marker)


def _lines(pairs: Array, role: Role, name: str, width: float, words: Sequence[str]) -> dict[str, Any]:
    """Lines through points (n, m, 3), each with a word."""
    gaps = np.full((len(pairs), 1, 3), np.nan)
    places = np.concatenate([pairs, gaps], axis=1).reshape(-1, 3)
    hover = np.repeat(list(words), pairs.shape[1] + 1).tolist()
    return _scatter(places, "lines", name, line={"width": width, "color": COLOURS[role]}, hovertext=hover)


def _scatter(places: Array, mode: str, name: str, **style: object) -> dict[str, Any]:
    columns = np.round(places, 3).T.tolist()
    x, y, z = ([None if np.isnan(value) else value for value in column] for column in columns)
    place = {"x": x, "y": y, "z": z}
    return {"type": "scatter3d", "mode": mode, "name": name, "hoverinfo": "text+name"} | place | style


def _traces(shapes: Iterable[Shape]) -> Iterator[dict[str, Any]]:
    """Shapes as traces: those of a kind and role in one."""
    ordered = sorted(shapes, key=_kind)
    for _, some in groupby(ordered, key=_kind):
        alike = list(some)
        match alike[0]:
            case Line(role=role, weight=weight):
                pairs = np.stack([one.points for one in alike])
                width = weight * WIDTHS.get(role, THIN)
                yield _lines(pairs, role, role, width, [role] * len(pairs)) | {"showlegend": False}
            case Surface():
                yield from map(_mesh, alike)
            case Ball(role=role):
                places = np.concatenate([one.points for one in alike])
                marker = {"size": 9 if role is Role.BALL else 4, "color": COLOURS[role]}
                yield _scatter(places, "markers", role, marker=marker, showlegend=False)
            case Label(role=role):
                places = np.stack([one.points[0] for one in alike])
                font = {"size": 17, "color": "#111111" if role is Role.LEG else COLOURS[role]}
                words = [one.text for one in alike if isinstance(one, Label)]
                yield _scatter(places, "text", role, text=words, textfont=font, showlegend=False)


def _kind(shape: Shape) -> tuple[str, str, float, int]:
    weight = shape.weight if isinstance(shape, Line) else 0.0
    return type(shape).__name__, shape.role, weight, len(shape.points)


def _mesh(shape: Shape) -> dict[str, Any]:
    """A surface as triangles about its first corner."""
    x, y, z = np.round(shape.points, 3).T.tolist()
    second, opacity = list(range(1, len(x) - 1)), 0.15 if shape.role is Role.BASE else 0.5
    place = {"x": x, "y": y, "z": z, "i": [0] * len(second), "j": second, "k": [n + 1 for n in second]}
    look = {"color": COLOURS[shape.role], "opacity": opacity, "hoverinfo": "skip"}
    return {"type": "mesh3d", "name": shape.role} | place | look
