"""Who is named is told once, in order and in bounded time; what waits survives, and is bounded."""

import errno
import os
import threading
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from hexacell.cell.loader import Cell
from hexacell.cell.operation import NotificationSettings, Occasion
from hexacell.errors import FileError
from hexacell.runs.run_folder import runs_folder
from hexacell.services.unattended import outbox
from hexacell.services.unattended.delivery import NoticeAddress
from hexacell.services.unattended.notice import Notice, NoticeUndelivered, PendingNotice
from hexacell.services.unattended.outbox import FOLDER, LONGEST_KEPT, MOST_KEPT, NoticeOutbox
from tests.hexacell.services.notify.notices import a_notice
from tests.hexacell.services.proposed_runs import a_cell
from tests.waiting import wait_until


class Post:
    """Takes notices, but not those to ``absent``."""

    def __init__(self) -> None:
        self.absent: set[str] = set()
        self.taken: list[tuple[str, str]] = []

    def __call__(self, address: NoticeAddress, notice: Notice) -> None:
        if address.name in self.absent:
            raise NoticeUndelivered("does not answer")
        self.taken.append((address.name, notice.id[-1]))


@pytest.fixture
def post() -> Post:
    return Post()


def told_cell(folder: Path, *people: NotificationSettings) -> Cell:
    cell = a_cell(folder)
    people = people or (person("one"), person("two"))
    return replace(cell, settings=cell.settings.model_copy(update={"notifications": people}))


def person(name: str, **settings: Any) -> NotificationSettings:
    return NotificationSettings(name=name, url="https://nowhere.invalid/", **settings)


def now_notice(number: int, **further: Any) -> Notice:
    return a_notice(number, at=datetime.now(UTC) - timedelta(minutes=60 - number), **further)


def test_each_is_told_of_what_the_cell_says(tmp_path, post) -> None:
    cell = told_cell(
        tmp_path,
        person("all", on=tuple(Occasion)[:5]),
        person("alarms", on=(Occasion.ALARM,)),
        person("bad"),
    )
    outbox.notify_all(cell, now_notice(1, occasions=(Occasion.PASS,)), post)
    assert post.taken == [("all", "1")]
    outbox.notify_all(cell, now_notice(2, occasions=(Occasion.PASS, Occasion.ALARM)), post)
    assert sorted(post.taken[1:]) == [("alarms", "2"), ("all", "2"), ("bad", "2")]
    assert outbox.waiting_notices(cell) == ()


def test_who_is_absent_is_told_later_in_order_and_once(tmp_path, post) -> None:
    cell = told_cell(tmp_path)
    post.absent = {"two"}
    outcome = outbox.notify_all(cell, now_notice(1), post)
    problems = {one.name: (one.sent, one.wait, one.problem) for one in outcome.deliveries}
    assert problems == {"one": (1, 0, None), "two": (0, 1, "does not answer")}
    outbox.notify_all(cell, now_notice(2), post)
    outbox.notify_all(cell, now_notice(2), post)  # the same end told again is one notice
    assert post.taken[:2] == [("one", "1"), ("one", "2")]
    post.taken[2:] = []
    outbox.notify_test(cell, a_notice(3, occasions=(Occasion.TEST,)), post)
    assert len(outbox.waiting_notices(cell)) == 2, "a test is not kept"
    post.taken[2:] = []
    post.absent = set()
    assert outbox.send_waiting(cell, post).are_all_sent
    assert post.taken[2:] == [("two", "1"), ("two", "2")]
    assert outbox.send_waiting(cell, post).deliveries == ()


def test_after_a_power_cut_between_telling_and_forgetting_it_is_told_again_with_its_id(
    tmp_path, post, monkeypatch
) -> None:
    cell = told_cell(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(outbox.NoticeOutbox, "forget", Mock(side_effect=FileError("no power")))
        outbox.notify_all(cell, now_notice(1), post)
    assert outbox.send_waiting(cell, post).are_all_sent
    assert sorted(post.taken) == [("one", "1")] * 2 + [("two", "1")] * 2
    assert outbox.waiting_notices(cell) == ()


def test_who_is_slow_is_waited_for_only_so_long_and_delays_nobody(tmp_path, post, monkeypatch) -> None:
    cell = told_cell(tmp_path)
    answer, ended = threading.Event(), threading.Event()

    def slow(address: NoticeAddress, notice: Notice) -> None:
        if address.name == "one":
            answer.wait()
            ended.set()
        else:
            post(address, notice)

    monkeypatch.setattr("hexacell.services.unattended.outbox.LONGEST_NOTIFYING_S", 0.2)
    problems = {one.name: one.problem for one in outbox.notify_all(cell, now_notice(1), slow).deliveries}
    assert problems == {"one": "not finished within 0.2 s", "two": None}
    assert [one.to for one in outbox.waiting_notices(cell)] == ["one"]
    answer.set()
    ended.wait()
    wait_until(lambda: outbox.waiting_notices(cell) == ())


def test_on_a_full_disk_it_is_told_all_the_same(tmp_path, post, monkeypatch) -> None:
    cell = told_cell(tmp_path)
    runs_folder(cell).mkdir(parents=True)

    def full(path: Path, *_: Any, **__: Any) -> None:
        raise FileError("the disk is full", subject=path)

    with monkeypatch.context() as patch:
        patch.setattr("hexacell.storage.atomic_files.write_atomically", full)
        patch.setattr(Path, "unlink", Mock(side_effect=OSError(errno.EROFS, os.strerror(errno.EROFS))))
        assert outbox.notify_all(cell, now_notice(1), post).are_all_sent
        post.absent = {"one"}
        (told, untold) = sorted(
            outbox.notify_all(cell, now_notice(2), post).deliveries, key=lambda one: -one.sent
        )
    assert (told.name, untold.name, untold.problem) == ("two", "one", "does not answer")
    assert outbox.waiting_notices(cell) == ()


def test_what_is_too_old_is_tried_once_more_and_then_given_up(tmp_path, post) -> None:
    cell = told_cell(tmp_path)
    old = a_notice(1, at=datetime.now(UTC) - timedelta(days=30))
    post.absent = {"one"}
    outcome = outbox.notify_all(cell, old, post)
    assert (outcome.dropped, post.taken) == (1, [("two", "1")])
    assert outbox.waiting_notices(cell) == ()


def test_two_processes_do_not_send_at_once(tmp_path, post) -> None:
    cell = told_cell(tmp_path)
    post.absent = {"one", "two"}
    outbox.notify_all(cell, now_notice(1), post)
    post.absent = set()
    with outbox.NoticeOutbox(runs_folder(cell)).held():
        (problem,) = outbox.send_waiting(cell, post).deliveries
    assert problem.problem == "another process is sending at this moment"
    assert post.taken == []


BEGIN = datetime(2026, 11, 1, tzinfo=UTC)


def pending(number: int, to: str = "one", minutes: float = 0.0) -> PendingNotice:
    return PendingNotice(to=to, notice=a_notice(number, at=BEGIN + timedelta(minutes=minutes)))


def test_it_is_found_again_in_order_until_it_is_told(tmp_path) -> None:
    waiting = [pending(9, minutes=0), pending(1, minutes=1), pending(5, minutes=2)]
    for one in reversed(waiting):
        NoticeOutbox(tmp_path).keep(one)
    assert NoticeOutbox(tmp_path).pending() == tuple(waiting)
    NoticeOutbox(tmp_path).forget(waiting[1])
    NoticeOutbox(tmp_path).forget(waiting[1])
    assert NoticeOutbox(tmp_path).pending() == (waiting[0], waiting[2])


def test_a_power_cut_while_it_is_kept_leaves_nothing_or_all(tmp_path, monkeypatch) -> None:
    box = NoticeOutbox(tmp_path)
    box.keep(pending(1))
    with monkeypatch.context() as patch:
        patch.setattr("hexacell.storage.atomic_files.os.replace", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            box.keep(pending(2, minutes=1))
    assert box.pending() == (pending(1),)


def test_it_is_bounded_in_age_and_number(tmp_path) -> None:
    box = NoticeOutbox(tmp_path)
    for number in range(MOST_KEPT + 3):
        box.keep(pending(number, minutes=number))
    now = BEGIN + timedelta(minutes=MOST_KEPT + 3)
    assert box.drop_old(now) == 3
    left = box.pending()
    assert (len(left), left[0].notice.id) == (MOST_KEPT, pending(3).notice.id)
    assert box.drop_old(BEGIN + LONGEST_KEPT + timedelta(minutes=50)) == 48
    assert box.drop_old(now - timedelta(days=400)) == 0, "a clock that is set back"
    assert box.drop_old(now + timedelta(days=400)) == MOST_KEPT - 48
    assert box.pending() == ()


def test_what_no_program_reads_goes_when_it_is_old(tmp_path) -> None:
    box = NoticeOutbox(tmp_path)
    box.keep(pending(1))
    remains = [tmp_path / FOLDER / name for name in ("half.json", ".hexacell-1-2.tmp")]
    (whole,) = (tmp_path / FOLDER).glob("*.json")
    for path in remains:
        path.write_bytes(whole.read_bytes() if path.suffix == ".tmp" else b"{")
    assert box.pending() == (pending(1),), "half a file and foreign ones are no notice"
    written = datetime.fromtimestamp(remains[0].stat().st_mtime, UTC)
    box.drop_old(written)
    assert all(path.exists() for path in remains)
    box.drop_old(written + LONGEST_KEPT + timedelta(seconds=2))
    assert list((tmp_path / FOLDER).iterdir()) == []
