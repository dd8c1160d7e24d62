"""Telling one notice to one address: by what its scheme says, tried again after pauses, in bounded time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import SimpleQueue

from hexacell.cell.notifications import BROKERS, WEBHOOKS, scheme_of
from hexacell.services.notify.address import NoticeAddress
from hexacell.services.notify.apprise_services import send_by_apprise
from hexacell.services.notify.mqtt import publish_by_mqtt
from hexacell.services.notify.notice import Notice
from hexacell.services.notify.undelivered import NoticeUndelivered
from hexacell.services.notify.webhook import post_to_webhook

PAUSES_S = (1.0, 4.0)
"""Before another attempt: a service that is just being restarted is back after them."""

TIMEOUT_S = 10.0
"""Of each wait within an attempt."""

LONGEST_ATTEMPT_S = 18.0
"""Of one attempt, also where a server answers a byte at a time; all of them fit into a minute."""

Sender = Callable[[NoticeAddress, Notice, float], None]


def deliver(
    address: NoticeAddress,
    notice: Notice,
    longest_s: float = LONGEST_ATTEMPT_S,
    pause: Callable[[float], object] = time.sleep,
) -> None:
    """Tell it, at once or at another attempt after a ``pause``, s.

    Raises:
        NoticeUndelivered: with the reason of the last attempt.
    """
    for pause_s in PAUSES_S:
        try:
            return _attempt(address, notice, longest_s)
        except NoticeUndelivered:
            pause(pause_s)
    return _attempt(address, notice, longest_s)


def _attempt(address: NoticeAddress, notice: Notice, longest_s: float) -> None:
    """In a thread that nobody waits for longer than that, and that ends with the process."""
    ended: SimpleQueue[str | None] = SimpleQueue()  # no error, whose traceback would keep connections open

    def act() -> None:
        try:
            _sender(address)(address, notice, min(TIMEOUT_S, longest_s))
        except NoticeUndelivered as error:
            ended.put(str(error))
        except Exception as error:
            ended.put(f"{type(error).__name__}: {address.masked(str(error))}")
        else:
            ended.put(None)

    worker = threading.Thread(target=act, daemon=True, name=f"notice to {address.name}")
    worker.start()
    worker.join(longest_s)
    if worker.is_alive():
        raise NoticeUndelivered(f"not taken within {longest_s:g} s")
    problem = ended.get_nowait()
    if problem is not None:
        raise NoticeUndelivered(problem)


def _sender(address: NoticeAddress) -> Sender:
    scheme = scheme_of(address.url)
    if scheme in WEBHOOKS:
        return post_to_webhook
    return publish_by_mqtt if scheme in BROKERS else send_by_apprise
