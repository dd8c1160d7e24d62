"""A notice by mail or to a chat service, through apprise."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from hexacell.cell.notifications import Occasion
from hexacell.services.notify.address import NoticeAddress
from hexacell.services.notify.notice import Notice
from hexacell.services.notify.undelivered import NoticeUndelivered

_LONGEST_REASON = 200


def send_by_apprise(address: NoticeAddress, notice: Notice, timeout_s: float) -> None:
    """One line as the message; with mail, the JSON as an attachment.

    Raises:
        NoticeUndelivered: the service did not take it, or apprise is not installed.
    """
    try:
        import apprise  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        raise NoticeUndelivered("apprise is not installed: install hexacell[notify]") from error
    log_of: Any = apprise.LogCapture  # which has no types
    with log_of(level=apprise.logging.WARNING, fmt="%(message)s") as log:
        # Not through Apprise.notify, whose pool of threads would keep this process from ending.
        service = apprise.Apprise.instantiate(_with_timeout(_with_login(address), timeout_s))
        if service is None:
            raise NoticeUndelivered("apprise does not know this kind of address; see its documentation")
        attached = _attachment(notice) if address.url.startswith("mailto") else None
        taken = service.notify(notice.line, title=notice.title, notify_type=_kind(notice), attach=attached)
        said = " ".join(log.getvalue().split())
    if not taken:
        raise NoticeUndelivered(address.masked(said)[:_LONGEST_REASON] or "the service did not take it")


def _attachment(notice: Notice) -> Any:  # noqa: ANN401 - as apprise's
    from apprise import AppriseAttachment  # noqa: PLC0415 - an optional extra
    from apprise.attachment import memory  # noqa: PLC0415 - likewise

    attachment: Any = memory.AttachMemory  # which has no types
    document = attachment(
        notice.model_dump_json(indent=1), name="hexacell.json", mimetype="application/json"
    )
    return AppriseAttachment([document])


def _kind(notice: Notice) -> str:
    if Occasion.PASS in notice.occasions:
        return "success"
    if Occasion.FAILURE in notice.occasions:
        return "failure"
    return "info" if Occasion.TEST in notice.occasions else "warning"


def _with_login(address: NoticeAddress) -> str:
    if address.user is None:
        return address.url
    scheme, _, rest = address.url.partition("://")
    password = "" if address.password is None else f":{quote(address.password, safe='')}"
    return f"{scheme}://{quote(address.user, safe='')}{password}@{rest}"


def _with_timeout(url: str, timeout_s: float) -> str:
    """Apprise has its own words for it, and leaves those away that it does not know."""
    return f"{url}{'&' if '?' in url else '?'}rto={timeout_s:g}&cto={timeout_s:g}"
