"""A notice delivered to one address: by webhook, MQTT or apprise, with retries, in bounded time.

Addresses have their secrets from the environment, or from a file of their own.
"""

from __future__ import annotations

import logging
import re
import ssl
import threading
import time
import urllib.error
import urllib.request
from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass, field
from http.client import HTTPException
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote

from hexacell.addresses import LINK_LOCAL, address_of, connect_to_no_link_local, is_link_local
from hexacell.cell import operation
from hexacell.cell.fields import Password, Section
from hexacell.cell.passwords import stated_secrets
from hexacell.errors import UsageError
from hexacell.services.unattended.notice import Notice, NoticeUndelivered
from hexacell.storage.toml_document import MASK

_log = logging.getLogger(__name__)

PARTS = ("url", "user", "password", "token")
_SHORTEST_SECRET = 3


class AddressFile(Section):
    """The content of a notification's ``password_file``."""

    url: Password | None = None
    user: Password | None = None
    password: Password | None = None
    token: Password | None = None


@dataclass(frozen=True, slots=True)
class NoticeAddress:
    """A resolved address. Only ``name`` may be shown; texts by others go through :meth:`masked` first."""

    name: str
    url: str = field(repr=False)
    user: str | None = field(default=None, repr=False)
    password: str | None = field(default=None, repr=False)
    token: str | None = field(default=None, repr=False)
    topic: str = ""
    ca_file: Path | None = None
    open_url: str | None = None
    link_local: bool = False

    def masked(self, text: str) -> str:
        """A text without anything of this address that is secret."""
        for secret in sorted(self._secrets(), key=len, reverse=True):
            text = text.replace(secret, MASK)
        return text

    def _secrets(self) -> set[str]:
        given = [self.user, self.password, self.token]
        if self.open_url != self.url:
            rest = self.url.partition("://")[2]
            netloc = re.split("[/?#]", rest)[0]
            user, _, password = netloc.rpartition("@")[0].partition(":")
            given += [self.url, netloc, user, password, *re.split("[?#]", rest)[1:]]
            given += re.split(r"[/&=?;#]", rest)
        whole = {one for one in given if one and len(one) >= _SHORTEST_SECRET}
        return whole | {unquote(one) for one in whole} | {quote(one, safe="") for one in whole}


def variable(name: str, part: str) -> str:
    """The variable of the environment for a part of an address."""
    return f"HEXACELL_NOTIFY_{re.sub(r'[^A-Z0-9]+', '_', name.upper()).strip('_')}_{part.upper()}"


def resolved_address(settings: operation.NotificationSettings, cell: str, folder: Path) -> NoticeAddress:
    """The address of a recipient; ``folder`` has the cell file, ``cell`` is the cell's name.

    Raises ``FileError`` if its password file cannot be read, or others can read or change it;
    ``UsageError`` if there is no url anywhere, or it or a variable cannot be one.
    """
    file = None if settings.password_file is None else folder / settings.password_file
    variables = {part: variable(settings.name, part) for part in PARTS}
    stated = stated_secrets(file, AddressFile, variables)
    found = {name: value.get_secret_value() for name, value in stated.items()}
    url = found.pop("url", settings.url)
    if not url or "://" not in url:
        raise UsageError(
            "the notification has no url",
            subject=settings.name,
            action=f"Write url in [[notifications]] or its password_file, or set "
            f"{variable(settings.name, 'url')}",
        )
    ca_file = None if settings.ca_file is None else folder / settings.ca_file
    try:
        operation.require_sendable(url)
    except UsageError as error:
        raise UsageError(error.problem, subject=settings.name, action=error.action) from error
    topic = settings.topic or f"hexacell/{re.sub(r'[#+/]', '-', cell)}"
    return NoticeAddress(
        settings.name,
        url,
        topic=topic.rstrip("/"),
        ca_file=ca_file,
        open_url=settings.url,
        link_local=settings.link_local,
        **found,
    )


PAUSES_S = (1.0, 4.0)
"""Waits before another attempt, s: a service that is just being restarted is back after them."""

TIMEOUT_S = 10.0
"""Longest wait within an attempt, s."""

LONGEST_ATTEMPT_S = 18.0
"""Longest attempt, s, also where a server answers a byte at a time; all attempts fit into a minute."""


def deliver(
    address: NoticeAddress,
    notice: Notice,
    longest_s: float = LONGEST_ATTEMPT_S,
    pause: Callable[[float], object] = time.sleep,
) -> None:
    """Deliver a notice, at once or later after a ``pause``, s; raises ``NoticeUndelivered``."""
    for pause_s in (*PAUSES_S, None):
        try:
            _attempt(address, notice, longest_s)
        except NoticeUndelivered as error:
            _log.warning("notice %s to %s: %s", notice.id, address.name, error)
            if pause_s is None:
                raise
            pause(pause_s)
        else:
            _log.info("notice %s is delivered to %s", notice.id, address.name)
            return


def _attempt(address: NoticeAddress, notice: Notice, longest_s: float) -> None:
    """In a thread that nobody waits for longer than that, and that ends with the process."""
    ended: SimpleQueue[str | None] = SimpleQueue()  # no error, whose traceback would keep connections open

    def act() -> None:
        try:
            scheme, send = operation.scheme_of(address.url), send_by_apprise
            if scheme in operation.WEBHOOKS:
                send = post_to_webhook
            elif scheme in operation.BROKERS:
                send = publish_by_mqtt
            _require_elsewhere(address)
            send(address, notice, min(TIMEOUT_S, longest_s))
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
    if (problem := ended.get_nowait()) is not None:
        raise NoticeUndelivered(problem)


def _require_elsewhere(address: NoticeAddress) -> None:
    """Refuse a host that is, resolves to, or leads to a link-local address, unless that is on purpose."""
    if address.link_local:
        return
    if any(is_link_local(host, by_name=True) for host in operation.hosts_of(address.url)):
        raise NoticeUndelivered(LINK_LOCAL)
    connect_to_no_link_local()  # a name may resolve otherwise by then


def post_to_webhook(address: NoticeAddress, notice: Notice, timeout_s: float) -> None:
    """POST it; ``Idempotency-Key`` has its id, which distinguishes a second delivery from a second run.

    Raises:
        NoticeUndelivered: it was not taken.
    """
    try:
        with _opener(address).open(_request(address, notice), timeout=timeout_s):
            return
    except urllib.error.HTTPError as error:
        error.close()
        raise NoticeUndelivered(f"the server answers {error.code}") from error
    except (OSError, HTTPException, ValueError) as error:
        reason = error.reason if isinstance(error, urllib.error.URLError) else error
        no_answer = "the server does not answer" if isinstance(reason, TimeoutError) else None
        words = no_answer or getattr(reason, "strerror", None) or str(reason)
        raise NoticeUndelivered(address.masked(words)) from error


def _opener(address: NoticeAddress) -> urllib.request.OpenerDirector:
    """Follows no redirection: another address must not get the password of this one."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(context=ssl.create_default_context(cafile=address.ca_file)),
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


if TYPE_CHECKING:
    from paho.mqtt.client import Client

PORTS = {"mqtt": 1883, "mqtts": 8883}
AT_LEAST_ONCE = 1


def publish_by_mqtt(address: NoticeAddress, notice: Notice, timeout_s: float) -> None:
    """Publish to ``TOPIC/state``, retained; a test to ``TOPIC/test``, which leaves the state alone.

    Raises:
        NoticeUndelivered: the broker did not acknowledge it, or paho-mqtt is not installed.
    """
    client, answered, answer = _client(address, timeout_s)
    url = address_of(address.url)
    is_test = operation.Occasion.TEST in notice.occasions
    try:
        client.connect(url.hostname or "", url.port or PORTS[url.scheme])
        client.loop_start()
        if not answered.wait(timeout_s):
            raise NoticeUndelivered("the broker does not answer")
        if answer:
            raise NoticeUndelivered(f"the broker refuses the connection: {answer[0]}")
        topic = f"{address.topic}/{'test' if is_test else 'state'}"
        sent = client.publish(topic, notice.model_dump_json(), AT_LEAST_ONCE, retain=not is_test)
        sent.wait_for_publish(timeout_s)
        if not sent.is_published():
            raise NoticeUndelivered("the broker does not acknowledge it")
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise NoticeUndelivered(address.masked(reason)) from error
    finally:
        client.disconnect()
        client.loop_stop()


def _client(address: NoticeAddress, timeout_s: float) -> tuple[Client, threading.Event, list[str]]:
    """A client, what is set when the broker has answered, and why it refused, if it did."""
    try:
        from paho.mqtt.client import Client, MQTTv311  # noqa: PLC0415 - an optional extra
        from paho.mqtt.enums import CallbackAPIVersion  # noqa: PLC0415 - likewise
    except ImportError as error:
        raise NoticeUndelivered("paho-mqtt is not installed: install hexacell[mqtt]") from error
    answered, answer = threading.Event(), list[str]()

    def heard(_client: Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:  # noqa: ANN401
        if reason.is_failure:
            answer.append(str(reason))
        answered.set()

    client = Client(CallbackAPIVersion.VERSION2, protocol=MQTTv311, reconnect_on_failure=False)
    client.connect_timeout = timeout_s
    client.on_connect = heard
    if address.user is not None:
        client.username_pw_set(address.user, address.password)
    if operation.scheme_of(address.url) == "mqtts":
        try:
            client.tls_set_context(ssl.create_default_context(cafile=address.ca_file))
        except OSError as error:
            raise NoticeUndelivered(f"{address.ca_file}: {error.strerror or error}") from error
    return client, answered, answer


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
        service = apprise.Apprise.instantiate(_apprise_url(address, timeout_s))
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
    file = attachment(notice.model_dump_json(indent=1), name="hexacell.json", mimetype="application/json")
    return AppriseAttachment([file])


def _kind(notice: Notice) -> str:
    if operation.Occasion.PASS in notice.occasions:
        return "success"
    if operation.Occasion.FAILURE in notice.occasions:
        return "failure"
    return "info" if operation.Occasion.TEST in notice.occasions else "warning"


def _apprise_url(address: NoticeAddress, timeout_s: float) -> str:
    url = address.url
    if address.user is not None:
        scheme, _, rest = url.partition("://")
        password = "" if address.password is None else f":{quote(address.password, safe='')}"
        url = f"{scheme}://{quote(address.user, safe='')}{password}@{rest}"
    return f"{url}{'&' if '?' in url else '?'}rto={timeout_s:g}&cto={timeout_s:g}"
