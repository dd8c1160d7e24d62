"""Text for the first line of every screen."""

from __future__ import annotations

from hexacell.text.screens.run_picture import RunPicture
from hexacell.text.screens.views import HeaderView, Urgency
from procedures.engine.command_loop import Status

MODES = {"optimise": "calibration", "quick": "quick level", "check": "check", "length": "length check"}
URGENT = {
    Status.FAULTED: Urgency.ALARM,
    Status.AWAITING_OPERATOR: Urgency.ATTENTION,
    Status.PAUSED: Urgency.ATTENTION,
    Status.PAUSING: Urgency.ATTENTION,
}


def header_view(cell: str, picture: RunPicture) -> HeaderView:
    """The cell, what is done there, its state, and who is in control."""
    described = picture.described
    if described is None:
        return HeaderView(cell, status="no run")
    if described.is_recorded:
        return HeaderView(
            cell, f"recorded {MODES[described.mode]} {described.folder.name}", _cursor(picture)
        )
    status = picture.status.value.upper()
    urgency = URGENT.get(picture.status, Urgency.CALM)
    return HeaderView(cell, MODES[described.mode], status, _control(picture), urgency)


def _cursor(picture: RunPicture) -> str:
    cursor = picture.cursor
    if cursor is None:
        return "RECORDED"
    speed = f"x{cursor.speed:g}" if cursor.speed else "halted"
    return f"{cursor.at:%Y-%m-%d %H:%M:%S} {cursor.sequence}/{cursor.last} {speed}"


def _control(picture: RunPicture) -> str:
    control = picture.control
    if control is None:
        return ""
    if control.is_in_control:
        return "you are in control"
    return f"watching, {control.who or 'nobody'} is in control"
