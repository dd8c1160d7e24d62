"""Secrets in TOML texts: which keys have them, and a copy of a text without them.

Secret is the text behind a key whose name ends with ``password``, ``secret``, ``token`` or the like, also
in a comment, and the password in an address such as ``http://user:password@host``.
"""

from __future__ import annotations

import re
from functools import lru_cache

from hexacell.storage.toml_document import SECRET_WORDS, KeyPath, TomlDocument, is_secret

MASK = "***"

_IN_A_COMMENT = re.compile(
    rf"(#[^\r\n]*?(?:{SECRET_WORDS})[\"']?[ \t]*[=: \t][ \t]*)[^\r\n]+", re.IGNORECASE
)
# What follows a host's port and a question mark is no password: mailto://host:25?from=a@b.
_IN_AN_ADDRESS = re.compile(r"(://[^\s/:@\"']*:)(?!\d{1,5}[?#])[^\s/@\"']+(?=@)")
_LIKE_A_SECRET = re.compile(
    rf"((?:{SECRET_WORDS}|connectpw|enablepw)[\"']?[ \t]*[=: \t][ \t]*)[^\r\n]+", re.IGNORECASE
)


def secret_paths(document: TomlDocument) -> list[KeyPath]:
    """Where the secrets of a document stand, those that are masked already left out."""
    found = [path for path in document.spans if is_secret(path)]
    return [path for path in found if not isinstance(document.value(path), list | dict | type(None))]


def clear_secrets(document: TomlDocument) -> list[KeyPath]:
    """The secrets of a document that are not masked."""
    return [path for path in secret_paths(document) if document.value(path) != MASK]


@lru_cache(maxsize=4)
def without_secrets(text: str) -> str:
    """A valid TOML text with every secret masked; every other character is kept."""
    document = TomlDocument.parse(text)
    masked = document.replaced(dict.fromkeys(secret_paths(document), f'"{MASK}"'))
    return _IN_AN_ADDRESS.sub(rf"\g<1>{MASK}", _without_secret_comments(masked))


def with_lines_masked(text: str) -> str:
    """Any text, valid or not, with what follows the name of a secret masked up to the end of its line."""
    return _IN_AN_ADDRESS.sub(rf"\g<1>{MASK}", _LIKE_A_SECRET.sub(rf'\g<1>"{MASK}"', text))


def _without_secret_comments(text: str) -> str:
    document = TomlDocument.parse(text)
    values = [
        span for path, span in document.spans.items() if not isinstance(document.value(path), list | dict)
    ]

    def masked(found: re.Match[str]) -> str:
        in_a_value = any(span.start <= found.start() < span.stop for span in values)
        return found[0] if in_a_value else f"{found[1]}{MASK}"

    return _IN_A_COMMENT.sub(masked, text)
