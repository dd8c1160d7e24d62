"""What is asked for a first cell file: each question with its place, its default and how it is read."""

import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from hexacell.cell.described_devices import DESCRIBED_GAUGES
from hexacell.cell.robot import ControllerOptions
from hexacell.plugins import Group, names
from hexacell.storage.toml_document import KeyPath

GAUGE_AXES = "xyz"
OPTIONS = "options"
"""Where a controller's section has what its protocol needs; answers of these are called so too."""

Document = dict[str, Any]


@dataclass(frozen=True, slots=True)
class CellAnswer:
    """One thing that is asked.

    Attributes:
        path: where the answer belongs.
        read: makes the value at the path of it, or raises ``ValueError`` with what is expected.
        put: enters an answer with more than this one value into a document, instead.
        is_asked: whether a person is asked; if not, its default counts until it is given.
        is_optional: whether it may be empty.
        meaning: what an option of a controller is, by its driver.
    """

    name: str
    path: KeyPath
    default: str
    read: Callable[[str], object] = str.strip
    put: Callable[[Document, str], None] | None = None
    is_asked: bool = True
    is_optional: bool = False
    meaning: str = ""

    def enter(self, document: Document, given: str) -> None:
        """Put an answer into a document; raises ``ValueError`` with what is expected."""
        if self.put is not None:
            self.put(document, given)
            return
        place: Any = document
        for key in self.path[:-1]:
            place = place[key]
        place[self.path[-1]] = self.read(given)


def number(given: str) -> float:
    """A number; raises ``ValueError``."""
    try:
        return float(given)
    except ValueError:
        raise ValueError(f"{given!r} is no number") from None


def whole(given: str) -> int:
    """A whole number; raises ``ValueError``."""
    try:
        return int(given)
    except ValueError:
        raise ValueError(f"{given!r} is no whole number") from None


def numbers(given: str, count: int, names: str, read: Callable[[str], float] = number) -> list[float]:
    """So many numbers, each read by itself; raises ``ValueError`` with what they are."""
    words = given.replace(",", " ").split()
    if len(words) != count:
        raise ValueError(f"{count} numbers are expected: {names}")
    return [read(word) for word in words]


def one_of(known: Sequence[str]) -> Callable[[str], str]:
    """What takes a known name; it raises ``ValueError`` for another."""

    def read(given: str) -> str:
        if given.strip() not in known:
            raise ValueError(f"it is one of {', '.join(known)}")
        return given.strip()

    return read


def _sign(given: str) -> int:
    signs = {"yes": 1, "y": 1, "no": -1, "n": -1}
    if given.strip().lower() not in signs:
        raise ValueError("answer yes or no")
    return signs[given.strip().lower()]


def gauge_answers(number: int) -> Iterator[CellAnswer]:
    """What is asked of one gauge."""
    name, place = f"gauges.{GAUGE_AXES[number]}", ("gauges", number)
    known = [one for one in names(Group.GAUGES) if one not in DESCRIBED_GAUGES]
    yield CellAnswer(f"{name}.protocol", (*place, "protocol"), "sylvac", one_of(known))
    yield CellAnswer(f"{name}.port", (*place, "port"), f"/dev/ttyUSB{number}")
    yield CellAnswer(f"{name}.sign", (*place, "sign"), "yes", _sign)


def option_answers(options: type[ControllerOptions]) -> Iterator[CellAnswer]:
    """A controller's options: those that it needs are asked; if it needs none, all."""
    needed = {name for name, field in options.model_fields.items() if field.is_required()}
    for name, field in options.model_fields.items():
        key = options.key(name)
        yield CellAnswer(
            f"{OPTIONS}.{key}",
            ("controller", OPTIONS, key),
            "",
            put=partial(_put_option, key, name in needed),
            is_asked=name in needed or not needed,
            is_optional=name not in needed,
            meaning=field.description or key,
        )


def _put_option(key: str, is_needed: bool, document: Document, given: str) -> None:
    """Enter a value as TOML has it, or else the text itself."""
    value: object = given.strip()
    if is_needed and not value:
        raise ValueError("it is needed")
    with suppress(tomllib.TOMLDecodeError):
        value = tomllib.loads(f"x = {given}")["x"]
    if value != "":
        document["controller"].setdefault(OPTIONS, {})[key] = value
