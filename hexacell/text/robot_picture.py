"""The robot in a picture for text: of a cell, or of a run with its errors before and after."""

import numpy as np

from hexacell.drawing.robot_scene import robot_scene
from hexacell.drawing.shapes import Role, arrows, enlargement
from hexacell.drawing.svg import svg_of
from hexacell.services.robot_view import RobotView

WORDS = {Role.BEFORE: "as found (brown)", Role.AFTER: "as left (blue)"}


def robot_picture(view: RobotView) -> tuple[str, str]:
    """The robot at its first pose with the errors of held-out poses, as SVG; and that in words."""
    pose = view.poses[0]
    shown = [one for one in view.measured if one.name != "records"] or view.measured
    scene = robot_scene(view.robot, pose)
    caption = f"The robot at {pose}: legs 1 to 6, the ball between its gauges x, y and z, the base frame."
    if shown:
        factor = enlargement((one.vectors for one in shown), view.robot.size(pose))
        for one in shown:
            scene += arrows(one.role, one.planned, factor * one.vectors)
        sides = " and ".join(
            f"{WORDS[one.role]}, up to {np.linalg.norm(one.vectors, axis=-1).max():.3f} mm" for one in shown
        )
        caption += f" Arrows: where the ball was instead, {factor:g} times as far: {sides}."
    return svg_of(scene, view.title, caption), caption
