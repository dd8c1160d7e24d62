"""Text for who was told, who was not, and what waits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from hexacell.cell.notifications import NotificationSettings, scheme_of
from hexacell.services.notify.notice import PendingNotice
from hexacell.services.notify.telling_people import TellingOutcome

NOBODY = "nobody is told; write [[notifications]] in the cell file"
NEXT_TIME = "sent at the next run, or by hexacell notify CELL --send"


def telling_line(outcome: TellingOutcome) -> str | None:
    """What went wrong, in one line; nothing if nothing did."""
    problems = [_problem(one.name, one.wait, one.problem) for one in outcome.people if one.problem]
    if outcome.dropped:
        problems.append(f"{outcome.dropped} notices were given up: too old, or too many")
    if not problems:
        return None
    waits = any(one.wait for one in outcome.people)
    return f"not told: {'; '.join(problems)}{f' ({NEXT_TIME})' if waits else ''}"


def telling_text(outcome: TellingOutcome) -> str:
    """A line for each who was told or not."""
    lines = [f"{one.name}: {one.problem or f'told ({one.told})'}" for one in outcome.people]
    if outcome.dropped:
        lines.append(f"{outcome.dropped} notices were given up: too old, or too many")
    return "\n".join(lines or ["nothing waits"])


def telling_document(outcome: TellingOutcome) -> dict[str, Any]:
    """What ``notify --send --json`` and ``--test --json`` print."""
    return {
        "told": [
            {"name": one.name, "told": one.told, "wait": one.wait, "problem": one.problem}
            for one in outcome.people
        ],
        "dropped": outcome.dropped,
    }


def notifications_text(settings: Sequence[NotificationSettings], waiting: Sequence[PendingNotice]) -> str:
    """Who is told of what, and what waits."""
    return "\n".join(_listed(settings, waiting)) or NOBODY


def notifications_document(
    settings: Sequence[NotificationSettings], waiting: Sequence[PendingNotice]
) -> dict[str, Any]:
    """What ``notify --json`` prints; without addresses."""
    return {
        "notifications": [{"name": one.name, "on": list(one.on)} for one in settings],
        "waiting": [one.model_dump(mode="json") for one in waiting],
    }


def _listed(settings: Sequence[NotificationSettings], waiting: Sequence[PendingNotice]) -> Iterator[str]:
    for one in settings:
        way = "as its password_file or the environment has it" if one.url is None else scheme_of(one.url)
        yield f"{one.name}: {way}; {', '.join(one.on)}"
    for pending in waiting:
        yield f"waits for {pending.to}: {pending.notice.at:%Y-%m-%d %H:%M} {pending.notice.line}"


def _problem(name: str, wait: int, problem: str | None) -> str:
    return f"{name}: {problem}{f', {wait} wait' if wait > 1 else ''}"
