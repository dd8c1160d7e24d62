"""Telling people: notices kept on the disk first, then sent; what is not taken waits for the next time.

Nothing here fails a run. What went wrong is in the :class:`Telling` of each who should have been told.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from threading import Thread

from hexacell.cell.loader import Cell
from hexacell.cell.notifications import NotificationSettings
from hexacell.errors import HexacellError
from hexacell.runs.run_folder import runs_folder
from hexacell.services.notify.address import NoticeAddress, resolved_address
from hexacell.services.notify.delivery import deliver
from hexacell.services.notify.notice import Notice, PendingNotice
from hexacell.services.notify.outbox import NoticeOutbox

Deliver = Callable[[NoticeAddress, Notice], None]

LONGEST_TELLING_S = 60.0
"""After so long a run ends, and what is not told waits for the next one."""

OTHER_PROCESS = "another process is sending at this moment"


@dataclass(frozen=True, slots=True)
class ToldPerson:
    """What became of the notices to one who is told.

    Attributes:
        told: how many were taken, and how many still ``wait``.
        problem: why not all were; none if all were.
    """

    name: str
    told: int
    wait: int
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class TellingOutcome:
    """Of all who are told; ``dropped`` is how many notices were too old, or too many, to be kept on."""

    people: tuple[ToldPerson, ...]
    dropped: int = 0

    @property
    def are_all_told(self) -> bool:
        """Whether nothing waits."""
        return not any(one.problem for one in self.people)


def tell_people(cell: Cell, notice: Notice, send: Deliver = deliver) -> TellingOutcome:
    """Tell all who are told of such a run, and whatever waited from earlier ones."""
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


def send_waiting(cell: Cell, send: Deliver = deliver) -> TellingOutcome:
    """Tell what waits from earlier runs."""
    return _send_all(cell, NoticeOutbox(runs_folder(cell)), send, ())


def tell_test(cell: Cell, notice: Notice, send: Deliver = deliver) -> TellingOutcome:
    """Tell everybody something now; what is not taken is not kept."""
    queues = {one.name: (PendingNotice(to=one.name, notice=notice),) for one in cell.settings.notifications}
    told = _in_parallel(cell, queues, lambda address, pending: send(address, pending.notice))
    people = (ToldPerson(name, done, 0, problem) for name, (done, problem) in told.items())
    return TellingOutcome(tuple(people))


def waiting_notices(cell: Cell) -> tuple[PendingNotice, ...]:
    """What is still to be told; raises ``FileError``."""
    return NoticeOutbox(runs_folder(cell)).pending()


def _send_all(
    cell: Cell, outbox: NoticeOutbox, send: Deliver, unkept: Sequence[PendingNotice]
) -> TellingOutcome:
    """Send what waits, and what could not be kept."""
    try:
        with outbox.held() as is_ours:
            if not is_ours:
                return TellingOutcome((ToldPerson("the outbox", 0, 0, OTHER_PROCESS),))
            queues = _queues(cell, (*outbox.pending(), *unkept))
            told = _in_parallel(cell, queues, _removing(outbox, send, unkept))
            dropped = outbox.drop_old(datetime.now(UTC))
    except HexacellError as error:
        return TellingOutcome((ToldPerson("the outbox", 0, 0, str(error)),))
    people = (
        ToldPerson(name, done, len(queues[name]) - done, problem) for name, (done, problem) in told.items()
    )
    return TellingOutcome(tuple(people), dropped)


def _queues(cell: Cell, waiting: Iterable[PendingNotice]) -> dict[str, tuple[PendingNotice, ...]]:
    """What each is to be told, in order. Who is told no longer waits until it is too old."""
    known = {one.name for one in cell.settings.notifications}
    queues: dict[str, tuple[PendingNotice, ...]] = {}
    for pending in waiting:
        if pending.to in known:
            queues[pending.to] = (*queues.get(pending.to, ()), pending)
    return queues


def _removing(
    outbox: NoticeOutbox, send: Deliver, unkept: Sequence[PendingNotice]
) -> Callable[[NoticeAddress, PendingNotice], None]:
    def act(address: NoticeAddress, pending: PendingNotice) -> None:
        send(address, pending.notice)
        if pending not in unkept:
            outbox.forget(pending)

    return act


def _in_parallel(
    cell: Cell,
    queues: Mapping[str, tuple[PendingNotice, ...]],
    act: Callable[[NoticeAddress, PendingNotice], None],
) -> dict[str, tuple[int, str | None]]:
    """How many each was told, and the problem; who does not answer delays nobody else.

    The threads end with the process: neither a stop signal nor the end of a run waits for a slow server.
    """
    settings = {one.name: one for one in cell.settings.notifications}
    told: dict[str, tuple[int, str | None]] = {}

    def tell(name: str) -> None:
        told[name] = _one_queue(cell, settings[name], queues[name], act)

    threads = {name: Thread(target=tell, args=(name,), daemon=True) for name in queues}
    for thread in threads.values():
        thread.start()
    until = time.monotonic() + LONGEST_TELLING_S
    for thread in threads.values():
        thread.join(max(0.0, until - time.monotonic()))
    return {name: told.get(name, (0, f"not finished within {LONGEST_TELLING_S:g} s")) for name in queues}


def _one_queue(
    cell: Cell,
    settings: NotificationSettings,
    queue: Iterable[PendingNotice],
    act: Callable[[NoticeAddress, PendingNotice], None],
) -> tuple[int, str | None]:
    """In order: after one that is not taken the others wait, so that no older state comes last."""
    told = 0
    try:
        address = resolved_address(settings, cell.settings.name, cell.path.parent)
        for pending in queue:
            act(address, pending)
            told += 1
    except HexacellError as error:
        return told, str(error)
    return told, None
