"""Libraries that only some devices need: imported when a cell has one of these, and named when missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from hexacell.errors import UsageError

PROJECT = "hexacell"


def optional(module: str, extra: str, subject: str) -> Any:  # noqa: ANN401 - a module, of whatever type
    """The module of an optional library.

    Raises:
        UsageError: it is not installed; the message has the command.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise UsageError(
            f"needs {module.partition('.')[0]}, which is not installed ({error})",
            subject=subject,
            action=f"Type: pip install '{PROJECT}[{extra}]'",
        ) from error
