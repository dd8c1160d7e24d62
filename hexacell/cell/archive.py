"""Where the index over a cell's runs is kept."""

from __future__ import annotations

import re

from pydantic import Field, field_validator

from hexacell.cell.fields import Section, Text, broken_rule

_POSTGRESQL = re.compile(r"postgresql://(?P<login>[^/@]*@)?[^/@]*/[^/?]+(?P<query>\?.*)?")


class ArchiveSettings(Section):
    """The index over the cell's runs; the runs themselves are in their folders."""

    url: Text | None = Field(
        None,
        description="postgresql://user@host/database, which several cells may share; without it, a file "
        "beside the runs. A password belongs in the user's ~/.pgpass",
    )

    @field_validator("url")
    @classmethod
    def _names_a_database_and_no_password(cls, url: str | None) -> str | None:
        mistake = None if url is None else mistake_in_url(url)
        if mistake is not None:
            raise broken_rule(*mistake)
        return url


def mistake_in_url(url: str) -> tuple[str, str] | None:
    """What is wrong with the address of a shared archive, and what to do; none if nothing is."""
    found = _POSTGRESQL.fullmatch(url)
    if found is None:
        return "this is no address of a PostgreSQL database", "Write postgresql://user@host/database"
    if ":" in (found["login"] or "") or "password" in (found["query"] or ""):
        return "a password does not belong here", "Put it into ~/.pgpass, and remove it"
    return None
