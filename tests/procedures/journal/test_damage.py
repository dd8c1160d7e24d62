"""A torn last line is dropped; damaged journals and unknown versions are refused with the line."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hexacell.errors import FileError
from procedures.journal.journal import VERSION, Journal, read_journal
from tests.procedures.journal.conftest import TOLD, checked, write_told


def test_a_tail_torn_at_any_byte_is_dropped(path: Path, written: bytes) -> None:
    begin = written.rindex(b"\n", 0, -1) + 1
    for end in range(begin, len(written)):
        path.write_bytes(written[:end])
        assert read_journal(path) == TOLD[:-1]
        with Journal(path) as journal:
            assert journal.events == TOLD[:-1]
        assert path.read_bytes() == written[:begin]


def test_a_valid_last_line_of_an_unknown_kind_is_refused(path: Path, written: bytes) -> None:
    body = b'{"n":%d,"at":"2026-11-20T10:30:00Z","s":1.0,"event":{"kind":"teleported"}}' % (len(TOLD) + 1)
    path.write_bytes(written + checked(body))
    with pytest.raises(FileError, match=r":5: .*not understood .*'teleported'") as refusal:
        Journal(path)
    assert refusal.value.action == "Use the version of hexacell that wrote it"
    assert path.read_bytes().startswith(written)


@pytest.mark.parametrize("twice", [0, 3])
def test_a_repeated_record_as_last_line_is_damage(path: Path, written: bytes, twice: int) -> None:
    path.write_bytes(written + written.splitlines(keepends=True)[twice])
    with pytest.raises(FileError, match=rf":5: .*damaged: record {twice + 1} is in the place of record 5"):
        read_journal(path)


def zeros(data: bytes, begin: int, end: int) -> bytes:
    return data[:begin] + bytes(len(data[begin:end])) + data[end:]


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_last_line_with_zeros_for_bytes_is_a_torn_tail(path: Path, data) -> None:
    """As file systems leave it that lengthen a file before its blocks are written."""
    written = path.read_bytes() if path.exists() else write_told(path)
    last = written.rindex(b"\n", 0, -1) + 1
    begin = data.draw(st.integers(last, len(written) - 1))
    end = data.draw(st.integers(begin + 1, len(written)))
    torn = path.with_name("torn")
    torn.write_bytes(zeros(written, begin, end) + bytes(data.draw(st.sampled_from([0, 1, 4096]))))
    assert read_journal(torn) == TOLD[:-1]
    with Journal(torn) as journal:
        journal.append(TOLD[-1])
    assert read_journal(torn) == TOLD


@pytest.mark.parametrize(
    "tail", [b"\n", b"\r", b"ab\rcd", b"ab\r\n", b"\x85\n", b"{}\n", b'"crc":"00000000"}\n', bytes(512)]
)
def test_any_bytes_after_the_last_record_are_one_torn_line(path: Path, written: bytes, tail: bytes) -> None:
    path.write_bytes(written + tail)
    assert read_journal(path) == TOLD


NO_RECORDS = (b"[]", b"3", b'"text"', b"null", b"{}", b'{"n": 1}', b"\xff\xfe")


@pytest.mark.parametrize(
    ("head", "tail", "line"),
    [
        *((b"", tail, 5) for tail in (b"\n\n", b"ab\ncd", b"ab\ncd\n")),
        *((one + b"\n", b"", 1) for one in NO_RECORDS),
    ],
)
def test_two_damaged_lines_or_one_in_front_are_more_than_a_torn_tail(path, written, head, tail, line):
    path.write_bytes(head + written + tail)
    with pytest.raises(FileError, match=rf":{line}: .*damaged"):
        read_journal(path)


def test_a_lost_line_end_before_the_last_line_loses_no_record(path: Path, written: bytes) -> None:
    """Both lines together look like one torn tail, but the first of them had been acknowledged."""
    place = written.rindex(b"\n", 0, -1)
    path.write_bytes(written[:place] + b"\x00" + written[place + 1 :])
    with pytest.raises(FileError, match=r":3: .*damaged"):
        read_journal(path)


def test_a_line_without_end_fills_no_memory_and_opening_a_damaged_journal_changes_nothing(path, written):
    path.write_bytes(written + b"x" * 1000)
    assert read_journal(path, longest_line=2000) == TOLD
    path.write_bytes(written + b"x" * 5000)
    with pytest.raises(FileError, match=r":5: .*damaged"):
        read_journal(path, longest_line=2000)
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


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
