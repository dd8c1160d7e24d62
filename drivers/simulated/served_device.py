"""What simulated devices have in common: they serve until closed, and their faults are switched."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol, Self


class Closeable(ABC):
    """A context manager that serves from its creation, and closes itself at the end."""

    @abstractmethod
    def close(self) -> None:
        """Stop serving and release everything; closing twice is harmless."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Switch(Protocol):
    """A fault of a device."""

    def __call__(self, *, on: bool) -> object:
        """Inject it, or clear it; from any thread."""
        ...
