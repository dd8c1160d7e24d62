"""Notices and addresses for tests."""

from datetime import UTC, datetime
from typing import Any

from hexacell.cell.operation import Occasion
from hexacell.services.unattended.delivery import NoticeAddress
from hexacell.services.unattended.notice import Notice


def a_notice(number: int = 1, **further: Any) -> Notice:
    values: dict[str, Any] = {
        "id": f"{number:032}",
        "cell": "cell 1",
        "host": "here",
        "run": f"run-{number}",
        "mode": "check",
        "at": datetime(2026, 11, 1, tzinfo=UTC).replace(second=number % 60),
        "occasions": (Occasion.NO_PASS, Occasion.ALARM),
        "exit_code": 1,
        "line": "cell 1: 0.310 mm (limit 0.25): fail",
    }
    return Notice(**values | further)


def an_address(url: str, **further: Any) -> NoticeAddress:
    return NoticeAddress("somebody", url, **{"topic": "hexacell/cell 1", "open_url": url} | further)
