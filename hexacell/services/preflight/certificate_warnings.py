"""Instruments whose certificate has expired: a person must approve what is found."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime

from hexacell.cell.loader import Cell


def certificate_warnings(cell: Cell) -> Iterator[str]:
    """One for each that has expired today, with what follows from it."""
    for name in cell.settings.expired_on(datetime.now(UTC).date()):
        due = cell.settings.certificates[name].due
        yield (
            f"the certificate of {name} expired on {due}: a person must approve what is found with it. "
            "Have it calibrated, and state its new certificate"
        )
