"""What is kept to be told survives, is told once, and is bounded."""

from datetime import UTC, datetime, timedelta
from unittest.mock import Mock

import pytest

from hexacell.services.unattended.notice import PendingNotice
from hexacell.services.unattended.outbox import FOLDER, LONGEST_KEPT, MOST_KEPT, NoticeOutbox
from tests.hexacell.services.notify.notices import a_notice

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
