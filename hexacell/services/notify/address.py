"""Where a notice goes, with the secrets that this takes: from the environment, or a file of their own."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from hexacell.cell.fields import Password, Section
from hexacell.cell.operation import NotificationSettings
from hexacell.cell.passwords import stated_secrets
from hexacell.errors import UsageError
from hexacell.storage.secrets import MASK

PARTS = ("url", "user", "password", "token")
_SHORTEST_SECRET = 3


class AddressFile(Section):
    """The content of a notification's ``password_file``."""

    url: Password | None = None
    user: Password | None = None
    password: Password | None = None
    token: Password | None = None


@dataclass(frozen=True, slots=True)
class NoticeAddress:
    """A resolved address. Only ``name`` may be shown; texts by others go through :meth:`masked` first."""

    name: str
    url: str = field(repr=False)
    user: str | None = field(default=None, repr=False)
    password: str | None = field(default=None, repr=False)
    token: str | None = field(default=None, repr=False)
    topic: str = ""
    ca_file: Path | None = None
    open_url: str | None = None

    def masked(self, text: str) -> str:
        """A text without anything of this address that is secret."""
        for secret in sorted(self._secrets(), key=len, reverse=True):
            text = text.replace(secret, MASK)
        return text

    def _secrets(self) -> set[str]:
        given = [self.user, self.password, self.token]
        if self.open_url != self.url:
            parts = urlsplit(self.url)
            given += [self.url, parts.username, parts.password, parts.query, parts.fragment]
            given += re.split(r"[/&=?;#]", f"{parts.path}&{parts.query}&{parts.fragment}")
            given += [parts.netloc]
        whole = {one for one in given if one and len(one) >= _SHORTEST_SECRET}
        return whole | {unquote(one) for one in whole} | {quote(one, safe="") for one in whole}


def variable(name: str, part: str) -> str:
    """The variable of the environment for a part of an address."""
    return f"HEXACELL_NOTIFY_{re.sub(r'[^A-Z0-9]+', '_', name.upper()).strip('_')}_{part.upper()}"


def resolved_address(
    settings: NotificationSettings,
    cell: str,
    folder: Path,
    environment: Mapping[str, str] = os.environ,
) -> NoticeAddress:
    """The address of a recipient; ``folder`` has the cell file, ``cell`` is the cell's name.

    Raises:
        FileError: its password file cannot be read, or others can read or change it.
        UsageError: there is no url anywhere, or a variable cannot be one.
    """
    file = None if settings.password_file is None else folder / settings.password_file
    variables = {part: variable(settings.name, part) for part in PARTS}
    stated = stated_secrets(file, AddressFile, variables, environment)
    found = {name: value.get_secret_value() for name, value in stated.items()}
    url = found.pop("url", settings.url)
    if not url or "://" not in url:
        raise UsageError(
            "the notification has no url",
            subject=settings.name,
            action=f"Write url in [[notifications]] or its password_file, or set "
            f"{variable(settings.name, 'url')}",
        )
    ca_file = None if settings.ca_file is None else folder / settings.ca_file
    topic = settings.topic or f"hexacell/{re.sub(r'[#+/]', '-', cell)}"
    return NoticeAddress(
        settings.name, url, topic=topic.rstrip("/"), ca_file=ca_file, open_url=settings.url, **found
    )
