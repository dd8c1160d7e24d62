"""What simulated devices have in common: they serve until closed, and their faults are switched."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import ExitStack
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


class ServedGroup(Closeable):
    """Several devices, served until it is closed; a subclass collects them in ``_served``."""

    _served: ExitStack

    def close(self) -> None:
        """Stop serving all of them; closing twice is harmless."""
        self._served.close()


class Switch(Protocol):
    """A fault of a device."""

    def __call__(self, *, on: bool) -> object:
        """Inject it, or clear it; from any thread."""


def setting(owner: object, attribute: str, faulty: object = True, sound: object = False) -> Switch:
    """A fault that is the value of an attribute."""

    def switch(*, on: bool) -> None:
        setattr(owner, attribute, faulty if on else sound)

    return switch


def lasting(inject: Callable[[], object]) -> Switch:
    """A fault whose effect stays when it is cleared."""

    def switch(*, on: bool) -> None:
        if on:
            inject()

    return switch
