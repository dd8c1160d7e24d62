"""Text for notices: who is notified of what, who could not be, and what waits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hexacell.cell.operation import NotificationSettings, scheme_of
from hexacell.services.notify.notice import PendingNotice
from hexacell.services.notify.outbox import NotifyOutcome

NOBODY = "nobody is notified; write [[notifications]] in the cell file"
NEXT_TIME = "sent at the next run, or by hexacell notify CELL --send"


def notify_line(outcome: NotifyOutcome) -> str | None:
    """What went wrong, in one line; None if nothing did."""
    problems = [
        f"{one.name}: {one.problem}{f', {one.wait} wait' if one.wait > 1 else ''}"
        for one in outcome.deliveries
        if one.problem
    ]
    problems += _dropped(outcome)
    if not problems:
        return None
    waits = any(one.wait for one in outcome.deliveries)
    return f"not notified: {'; '.join(problems)}{f' ({NEXT_TIME})' if waits else ''}"


def notify_text(outcome: NotifyOutcome) -> str:
    """A line for each recipient: how many notices it took, or why not."""
    lines = [f"{one.name}: {one.problem or f'notified ({one.sent})'}" for one in outcome.deliveries]
    return "\n".join([*lines, *_dropped(outcome)] or ["nothing waits"])


def _dropped(outcome: NotifyOutcome) -> list[str]:
    return [f"{outcome.dropped} notices were given up: too old, or too many"] if outcome.dropped else []


def notify_document(outcome: NotifyOutcome) -> dict[str, Any]:
    """The JSON document of ``notify --send --json`` and ``--test --json``."""
    return {
        "told": [
            {"name": one.name, "told": one.sent, "wait": one.wait, "problem": one.problem}
            for one in outcome.deliveries
        ],
        "dropped": outcome.dropped,
    }


def notifications_text(settings: Sequence[NotificationSettings], waiting: Sequence[PendingNotice]) -> str:
    """Who is notified of what, and what waits."""
    lines = [
        f"{one.name}: "
        f"{'as its password_file or the environment has it' if one.url is None else scheme_of(one.url)}; "
        f"{', '.join(one.on)}"
        for one in settings
    ]
    lines += [f"waits for {one.to}: {one.notice.at:%Y-%m-%d %H:%M} {one.notice.line}" for one in waiting]
    return "\n".join(lines) or NOBODY


def notifications_document(
    settings: Sequence[NotificationSettings], waiting: Sequence[PendingNotice]
) -> dict[str, Any]:
    """The JSON document of ``notify --json``, without addresses."""
    return {
        "notifications": [{"name": one.name, "on": list(one.on)} for one in settings],
        "waiting": [one.model_dump(mode="json") for one in waiting],
    }
