"""Damaged journals and unknown versions are refused with the line number and not changed."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hexacell.errors import FileError
from procedures.journal.journal import VERSION, Journal, read_journal
from tests.procedures.journal.told import TOLD, checked, write_told


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_damaged_line_before_the_last_is_refused_with_its_number(path, written, number):
    lines = written.split(b"\n")
    for place in range(0, len(lines[number - 1]), 7):
        line = bytearray(lines[number - 1])
        line[place] ^= 0x01
        path.write_bytes(b"\n".join([*lines[: number - 1], bytes(line), *lines[number:]]))
        with pytest.raises(FileError, match="damaged") as refusal:
            read_journal(path)
        assert refusal.value.line == number
        assert refusal.value.subject == str(path)


def test_opening_a_damaged_journal_does_not_change_it(path: Path, written: bytes) -> None:
    damaged = written.replace(b"a tester", b"a taster")
    path.write_bytes(damaged)
    with pytest.raises(FileError, match=r":2: .*damaged"):
        Journal(path)
    assert path.read_bytes() == damaged


@pytest.mark.parametrize("order", [[0, 2, 3], [1, 0, 2, 3], [0, 0, 1, 2]])
def test_lines_left_out_exchanged_or_twice_are_damage(path: Path, written: bytes, order: list[int]) -> None:
    lines = written.splitlines(keepends=True)
    path.write_bytes(b"".join(lines[place] for place in order))
    with pytest.raises(FileError, match="damaged"):
        read_journal(path)


def test_an_event_of_a_later_version_is_refused_not_skipped(path: Path, written: bytes) -> None:
    record = {"n": 1, "at": "2026-11-20T10:30:00.000Z", "event": {"kind": "teleported"}}
    checksum = zlib.crc32(json.dumps(record, separators=(",", ":")).encode())
    line = json.dumps({**record, "crc": f"{checksum:08x}"}, separators=(",", ":")).encode()
    path.write_bytes(line + b"\n" + written.split(b"\n", 1)[1])
    with pytest.raises(FileError, match=":1: "):
        read_journal(path)


@pytest.mark.parametrize("line", [b"[]", b"3", b'"text"', b"null", b"{}", b'{"n": 1}', b"\xff\xfe"])
def test_lines_that_are_no_records_are_damage(path: Path, written: bytes, line: bytes) -> None:
    path.write_bytes(line + b"\n" + written)
    with pytest.raises(FileError, match=":1: "):
        read_journal(path)


def test_the_first_line_states_the_version(written: bytes) -> None:
    first, *others = (json.loads(line) for line in written.splitlines())
    assert first["version"] == VERSION
    assert not any("version" in record for record in others)


def test_a_journal_of_a_newer_version_is_refused_plainly(path: Path) -> None:
    body = b'{"n":1,"version":%d,"whatever":["comes"]}' % (VERSION + 1)
    path.write_bytes(checked(body) + b"what follows is not looked at\n")
    with pytest.raises(FileError, match=rf":1: a newer hexacell .* version {VERSION + 1}") as refusal:
        read_journal(path)
    assert refusal.value.action == "Use that hexacell, or update this one"
    before = path.read_bytes()
    with pytest.raises(FileError, match="newer"):
        Journal(path)
    assert path.read_bytes() == before


def test_a_journal_that_states_no_version_is_refused(path: Path) -> None:
    path.write_bytes(checked(b'{"n":1,"at":"2026-11-20T10:30:00.000Z","s":1.0,"event":{"kind":"resumed"}}'))
    with pytest.raises(FileError, match="states no version"):
        read_journal(path)


@settings(max_examples=500, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_changed_byte_is_always_detected(path: Path, data) -> None:
    written = bytearray(path.read_bytes() if path.exists() else write_told(path))
    place = data.draw(st.integers(0, len(written) - 1))
    written[place] ^= data.draw(st.integers(1, 255))
    spoiled = path.with_name("spoiled")
    spoiled.write_bytes(written)
    last = len(TOLD) - 1
    if place > path.read_bytes().rindex(b"\n", 0, -1):
        if written[place] == ord("\n"):  # the last line is two now, which no torn tail is
            with pytest.raises(FileError):
                read_journal(spoiled)
        else:
            assert read_journal(spoiled) == TOLD[:last]
        return
    with pytest.raises(FileError) as refusal:
        read_journal(spoiled)
    assert refusal.value.line == path.read_bytes().count(b"\n", 0, place) + 1
