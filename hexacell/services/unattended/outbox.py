"""Notices kept on the disk until each address has them, and sent: now, or at the next run.

Every notice is in a file of its own before it is sent. Whatever is not delivered is sent the next time.
Nothing here fails a run: what went wrong is in the outcome of each address.
"""

import fcntl
import os
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Thread

from pydantic import ValidationError

from hexacell.cell.loader import Cell
from hexacell.errors import FileError, HexacellError
from hexacell.runs.run_folder import runs_folder
from hexacell.services.unattended.delivery import NoticeAddress, deliver, resolved_address
from hexacell.services.unattended.notice import Notice, PendingNotice, notice_id
from hexacell.storage import atomic_files

FOLDER = ".outbox"
"""Beside a cell's runs; hidden folders are no runs."""

MOST_KEPT = 100
LONGEST_KEPT = timedelta(days=7)
LARGEST_NOTICE_BYTES = 100_000


class NoticeOutbox:
    """The notices of one cell; ``folder`` has its runs and is made when it is needed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER

    def keep(self, pending: PendingNotice) -> None:
        """Keep a notice until it is delivered; keeping the same one again changes nothing.

        Raises:
            FileError: it cannot be kept, as on a full disk.
        """
        atomic_files.create_folder_durably(self._folder)
        atomic_files.write_own(self._file(pending), pending.model_dump_json().encode() + b"\n")

    def forget(self, pending: PendingNotice) -> None:
        """Remove a notice that was delivered.

        Raises:
            FileError: it cannot be removed; it will be sent once more.
        """
        path = self._file(pending)
        with atomic_files.os_errors("cannot be removed", path), suppress(FileNotFoundError):
            path.unlink()
            atomic_files.sync_folder(self._folder)

    def pending(self) -> tuple[PendingNotice, ...]:
        """The notices not delivered yet, the oldest first; unreadable files are left out.

        Raises:
            FileError: the folder cannot be read.
        """
        with atomic_files.os_errors("cannot be read", self._folder):
            paths = sorted(self._folder.glob("*.json"))
        found = [one for path in paths if (one := _read(path)) is not None]
        return tuple(sorted(found, key=lambda one: (one.notice.at, one.notice.id, one.to)))

    def drop_old(self, now: datetime) -> int:
        """Give up what is too old or too much, the oldest first; gives how many; raises ``FileError``."""
        waiting = self.pending()
        kept = [one for one in waiting if one.notice.at > now - LONGEST_KEPT][-MOST_KEPT:]
        for one in waiting:
            if one not in kept:
                self.forget(one)
        # Files that no program reads, as those of a process that died while it wrote them.
        damaged = [path for path in self._folder.glob("*.json") if _read(path) is None]
        for path in (*self._folder.glob(".hexacell-*.tmp"), *damaged):
            with suppress(OSError):
                if path.stat().st_mtime < (now - LONGEST_KEPT).timestamp():
                    path.unlink()
        return len(waiting) - len(kept)

    @contextmanager
    def held(self) -> Iterator[bool]:
        """Whether this process alone sends from here, as long as this is held."""
        try:
            descriptor = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        except FileNotFoundError:
            yield True
            return
        except OSError as error:
            raise atomic_files.os_error_to_file_error("cannot be read", self._folder, error) from error
        try:
            is_ours = False
            with suppress(BlockingIOError):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                is_ours = True
            yield is_ours
        finally:
            os.close(descriptor)

    def _file(self, pending: PendingNotice) -> Path:
        return self._folder / f"{notice_id(pending.notice.id, pending.to)}.json"


def _read(path: Path) -> PendingNotice | None:
    try:
        return PendingNotice.model_validate_json(atomic_files.read_text(path, LARGEST_NOTICE_BYTES))
    except (FileError, ValidationError):
        return None


Deliver = Callable[[NoticeAddress, Notice], None]

LONGEST_NOTIFYING_S = 60.0
"""Longest time that a run waits for its notices, s; what is not delivered then waits for the next run."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """How many notices one recipient took, how many still wait, and why; no problem if all were taken."""

    name: str
    sent: int
    wait: int
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class NotifyOutcome:
    """What became of all notices; ``dropped`` is how many were too old, or too many, to be kept."""

    deliveries: tuple[Delivery, ...]
    dropped: int = 0

    @property
    def are_all_sent(self) -> bool:
        """Whether nothing waits."""
        return not any(one.problem for one in self.deliveries)


def notify_all(cell: Cell, notice: Notice, send: Deliver = deliver) -> NotifyOutcome:
    """Send a notice to all who want such runs, and whatever waits from earlier ones."""
    outbox = NoticeOutbox(runs_folder(cell))
    wanted = [one for one in cell.settings.notifications if not set(notice.occasions).isdisjoint(one.on)]
    unkept: list[PendingNotice] = []
    for one in wanted:
        pending = PendingNotice(to=one.name, notice=notice)
        try:
            outbox.keep(pending)
        except HexacellError:
            unkept.append(pending)
    return _send_all(cell, outbox, send, unkept)


def send_waiting(cell: Cell, send: Deliver = deliver) -> NotifyOutcome:
    """Send what waits from earlier runs."""
    return _send_all(cell, NoticeOutbox(runs_folder(cell)), send, ())


def notify_test(cell: Cell, notice: Notice, send: Deliver = deliver) -> NotifyOutcome:
    """Send a notice to everybody now; what is not taken is not kept."""
    queues = {one.name: [PendingNotice(to=one.name, notice=notice)] for one in cell.settings.notifications}
    sent = _in_parallel(cell, queues, lambda address, pending: send(address, pending.notice))
    return NotifyOutcome(tuple(replace(one, wait=0) for one in sent))


def waiting_notices(cell: Cell) -> tuple[PendingNotice, ...]:
    """The notices not delivered yet; raises ``FileError``."""
    return NoticeOutbox(runs_folder(cell)).pending()


def _send_all(
    cell: Cell, outbox: NoticeOutbox, send: Deliver, unkept: Sequence[PendingNotice]
) -> NotifyOutcome:

    def act(address: NoticeAddress, pending: PendingNotice) -> None:
        send(address, pending.notice)
        if pending not in unkept:
            outbox.forget(pending)

    known = {one.name for one in cell.settings.notifications}
    queues: defaultdict[str, list[PendingNotice]] = defaultdict(list)
    try:
        with outbox.held() as is_ours:
            if not is_ours:
                problem = "another process is sending at this moment"
                return NotifyOutcome((Delivery("the outbox", 0, 0, problem),))
            for pending in (*outbox.pending(), *unkept):
                if pending.to in known:  # others are no longer notified; theirs wait until they are too old
                    queues[pending.to].append(pending)
            sent = _in_parallel(cell, queues, act)
            dropped = outbox.drop_old(datetime.now(UTC))
    except HexacellError as error:
        return NotifyOutcome((Delivery("the outbox", 0, 0, str(error)),))
    return NotifyOutcome(sent, dropped)


def _in_parallel(
    cell: Cell,
    queues: Mapping[str, Sequence[PendingNotice]],
    act: Callable[[NoticeAddress, PendingNotice], None],
) -> tuple[Delivery, ...]:
    """Send each recipient its queue in order, so that no older state comes last; none delays another.

    The threads end with the process: neither a stop signal nor the end of a run waits for a slow server.
    """
    settings = {one.name: one for one in cell.settings.notifications}
    late = f"not finished within {LONGEST_NOTIFYING_S:g} s"
    sent = {name: Delivery(name, 0, len(queue), late) for name, queue in queues.items()}

    def send_queue(name: str) -> None:
        done, problem = 0, None
        try:
            address = resolved_address(settings[name], cell.settings.name, cell.path.parent)
            for pending in queues[name]:
                act(address, pending)
                done += 1
        except HexacellError as error:
            problem = str(error)
        sent[name] = Delivery(name, done, len(queues[name]) - done, problem)

    threads = {name: Thread(target=send_queue, args=(name,), daemon=True) for name in queues}
    for thread in threads.values():
        thread.start()
    until = time.monotonic() + LONGEST_NOTIFYING_S
    for thread in threads.values():
        thread.join(max(0.0, until - time.monotonic()))
    return tuple(sent.values())
