"""Mutations of journals: as bytes, and of their content with the checksums made right again."""

import json
import random
import zlib
from collections.abc import Callable
from typing import Any

from tests.mutations.texts import ANY, STRANGE_TEXTS, TOML, mutated

STRANGE_VALUES: tuple[Any, ...] = (
    None, True, [], {}, [[]], "", 0, -1, 1, 2, 3, 99, 10**24, 2**63 - 1, -(2**63), 1e308, -1e308, 1e-320,
    float("nan"), float("inf"), float("-inf"), -0.0, 5500.0, 1e6, 1e-9, [0.0] * 3, [0.0] * 6, [1e308] * 6,
    *STRANGE_TEXTS,
)  # fmt: skip

Place = tuple[Any, Any]
"""A container and a key or an index of it."""


def with_checksum(record: dict[str, Any]) -> bytes:
    """A line of a journal."""
    body = json.dumps(record, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "surrogatepass")
    return b'%b,"crc":"%08x"}\n' % (body[:-1], zlib.crc32(body))


def _places(value: Any) -> list[Place]:
    """Every place below a value."""
    pairs = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    return [place for key, inner in pairs for place in ((value, key), *_places(inner))]


def _another_value(records: list[dict[str, Any]], draw: random.Random) -> None:
    record = records[0] if draw.random() < 0.15 else draw.choice(records)
    container, key = draw.choice(_places(record["event"]))
    old = container[key]
    if isinstance(old, int | float) and not isinstance(old, bool) and draw.random() < 0.5:
        container[key] = old * draw.choice((-1, 2, 1000, 0, 1.01)) + draw.choice((0, 0, 1))
    elif isinstance(old, str) and key == "cell_text":
        container[key] = mutated(old.encode(), TOML, draw).decode("utf-8", "replace")
    elif isinstance(old, list) and old and draw.random() < 0.5:
        container[key] = draw.choice((old[:-1], old * 2, old[::-1], []))
    else:
        container[key] = draw.choice(STRANGE_VALUES)


def _key_lost(records: list[dict[str, Any]], draw: random.Random) -> None:
    container, key = draw.choice(_places(draw.choice(records)["event"]))
    del container[key]


def _event_lost(records: list[dict[str, Any]], draw: random.Random) -> None:
    if len(records) > 1:
        del records[draw.randrange(len(records))]


def _event_repeated(records: list[dict[str, Any]], draw: random.Random) -> None:
    copied = json.loads(json.dumps(draw.choice(records)))
    records.insert(draw.randrange(len(records) + 1), copied)


def _events_exchanged(records: list[dict[str, Any]], draw: random.Random) -> None:
    first, second = draw.randrange(len(records)), draw.randrange(len(records))
    records[first], records[second] = records[second], records[first]


def _ends_early(records: list[dict[str, Any]], draw: random.Random) -> None:
    del records[draw.randrange(1, len(records) + 1) :]


FORGERIES: tuple[Callable[[list[dict[str, Any]], random.Random], None], ...] = (
    _another_value, _another_value, _another_value, _another_value, _another_value, _key_lost, _event_lost,
    _event_repeated, _events_exchanged, _ends_early,
)  # fmt: skip


def forged(journal: bytes, draw: random.Random) -> bytes:
    """Another content, with numbers and checksums as if the program had written it."""
    records = [json.loads(line) for line in journal.splitlines()]
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        draw.choice(FORGERIES)(records, draw)
    version = records[0].get("version", 8) if records else 8
    lines = []
    for number, record in enumerate(records, start=1):
        record.pop("crc", None)
        first = {"version": record.get("version", version)} if number == 1 else {}
        rest = {key: record[key] for key in ("at", "s", "event") if key in record}
        lines.append(with_checksum({"n": number, **first, **rest}))
    return b"".join(lines)


def mutated_journal(journal: bytes, draw: random.Random) -> bytes:
    """Forged mostly, otherwise damaged."""
    return forged(journal, draw) if draw.random() < 0.8 else mutated(journal, ANY, draw)
