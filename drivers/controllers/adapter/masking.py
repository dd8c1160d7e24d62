"""What is secret of a program's settings: sent, and masked in everything that is kept or shown."""

import json
from collections.abc import Mapping
from typing import Any

from pydantic import SecretStr

from hexacell.storage.toml_document import MASK, is_secret


class Masking:
    """Masks every secret of some settings in texts."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self._secrets = [text for text in _secrets(settings) if text]

    def __call__(self, text: str) -> str:
        """The text without secrets, as they are or as JSON has them."""
        for secret in self._secrets:
            text = text.replace(json.dumps(secret, ensure_ascii=False)[1:-1], MASK).replace(secret, MASK)
        return text


def revealed(value: Any) -> Any:  # noqa: ANN401 - what TOML can hold
    """Settings as they are sent."""
    if isinstance(value, SecretStr):
        return value.get_secret_value()
    if isinstance(value, Mapping):
        return {name: revealed(one) for name, one in value.items()}
    return [revealed(one) for one in value] if isinstance(value, list | tuple) else value


def _secrets(value: Any, *, is_one: bool = False) -> list[str]:  # noqa: ANN401
    """Every secret in settings, as text."""
    if isinstance(value, Mapping):
        several = (_secrets(one, is_one=is_one or is_secret((name,))) for name, one in value.items())
        return [text for some in several for text in some]
    if isinstance(value, list | tuple):
        return [text for one in value for text in _secrets(one, is_one=is_one)]
    if isinstance(value, SecretStr):
        return [value.get_secret_value()]
    return [str(value)] if is_one else []
