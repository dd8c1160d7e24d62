"""The address of a shared archive in a cell file."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from hexacell.cell.operation import ArchiveSettings


@pytest.mark.parametrize(
    "url", ["postgresql://me@host/cells", "postgresql://host:5433/cells", "postgresql://me@/db?host=/run"]
)
def test_a_database_is_named(url: str) -> None:
    assert ArchiveSettings(url=url).url == url


@pytest.mark.parametrize(
    ("url", "problem"),
    [
        ("postgresql://me:secret@host/cells", "a password does not belong here"),
        ("postgresql://me@host/cells?password=secret", "a password does not belong here"),
        ("postgresql://host", "no address"),
        ("mysql://host/cells", "no address"),
        ("index.sqlite", "no address"),
    ],
)
def test_anything_else_is_refused(url: str, problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        ArchiveSettings(url=url)
