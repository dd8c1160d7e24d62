"""A notice to a webhook: its JSON in one POST request, RFC 9110."""

from __future__ import annotations

import ssl
import urllib.error
import urllib.request
from base64 import b64encode
from http.client import HTTPException

from hexacell.services.notify.address import NoticeAddress
from hexacell.services.notify.notice import Notice
from hexacell.services.notify.undelivered import NoticeUndelivered


def post_to_webhook(address: NoticeAddress, notice: Notice, timeout_s: float) -> None:
    """POST it; ``Idempotency-Key`` has its id, by which a second delivery is told from a second run.

    Raises:
        NoticeUndelivered: it was not taken.
    """
    try:
        with _opener(address).open(_request(address, notice), timeout=timeout_s):
            return
    except urllib.error.HTTPError as error:
        error.close()
        raise NoticeUndelivered(f"the server answers {error.code}") from error
    except urllib.error.URLError as error:
        raise NoticeUndelivered(address.masked(_words(error.reason))) from error
    except (OSError, HTTPException, ValueError) as error:
        raise NoticeUndelivered(address.masked(_words(error))) from error


def _opener(address: NoticeAddress) -> urllib.request.OpenerDirector:
    """Follows no redirection: another address must not get the password of this one."""
    trusted = None if address.ca_file is None else str(address.ca_file)
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(context=ssl.create_default_context(cafile=trusted)),
        urllib.request.HTTPErrorProcessor(),
        urllib.request.HTTPDefaultErrorHandler(),
    ):
        opener.add_handler(handler)
    return opener


def _request(address: NoticeAddress, notice: Notice) -> urllib.request.Request:
    headers = {"Content-Type": "application/json", "Idempotency-Key": notice.id, "User-Agent": "hexacell"}
    if address.token is not None:
        headers["Authorization"] = f"Bearer {address.token}"
    elif address.user is not None:
        login = f"{address.user}:{address.password or ''}".encode()
        headers["Authorization"] = f"Basic {b64encode(login).decode()}"
    # Only http and https come here: the scheme chose this sender.
    return urllib.request.Request(address.url, notice.model_dump_json().encode(), headers)  # noqa: S310


def _words(reason: object) -> str:
    if isinstance(reason, TimeoutError):
        return "the server does not answer"
    return (reason.strerror if isinstance(reason, OSError) else None) or str(reason)
