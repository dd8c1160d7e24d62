"""Where the secrets of an address come from, and that none is shown."""

import os
import socket
from ipaddress import ip_address
from itertools import cycle
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from hexacell import addresses
from hexacell.addresses import address_of
from hexacell.cell.operation import NotificationSettings
from hexacell.errors import FileError, UsageError
from hexacell.services.unattended.delivery import NoticeAddress, deliver, resolved_address, variable
from hexacell.services.unattended.notice import NoticeUndelivered
from tests.hexacell.services.notify.local_servers import LOOPBACK, broker, webhook
from tests.hexacell.services.notify.notices import a_notice, an_address

CHAT = "slack://hidden-a/hidden-b/hidden-c/#general?footer=hidden-d"


def resolve(folder: Path, environment: dict[str, str] | None = None, **settings: Any) -> NoticeAddress:
    with patch.dict(os.environ, environment or {}):
        return resolved_address(NotificationSettings(name="night shift", **settings), "cell #1", folder)


def private_file(folder: Path, text: str, mode: int = 0o600) -> str:
    path = folder / "notify.toml"
    path.write_text(text)
    path.chmod(mode)
    return path.name


def test_the_environment_comes_before_the_file_and_the_file_before_the_cell_file(tmp_path) -> None:
    name = private_file(tmp_path, 'url = "https://file/x"\nuser = "file"\npassword = "file"\n')
    found = resolve(tmp_path, url="https://cell/x", password_file=name)
    assert (found.url, found.user, found.password) == ("https://file/x", "file", "file")
    environment = {"HEXACELL_NOTIFY_NIGHT_SHIFT_PASSWORD": "environment"}
    assert variable("night shift", "password") in environment
    found = resolve(tmp_path, environment, url="https://cell/x", password_file=name)
    assert (found.user, found.password) == ("file", "environment")
    assert resolve(tmp_path, url="https://cell/x").url == "https://cell/x"


def test_a_topic_is_made_of_the_cell_s_name(tmp_path) -> None:
    assert resolve(tmp_path, url="mqtt://x").topic == "hexacell/cell -1"
    assert resolve(tmp_path, url="mqtt://x", topic="hall/7/").topic == "hall/7"


@pytest.mark.parametrize("mode", [0o604, 0o620, 0o666])
def test_a_file_that_others_can_read_or_change_is_refused(tmp_path, mode) -> None:
    name = private_file(tmp_path, 'password = "x"\n', mode)
    with pytest.raises(FileError, match="chmod 600"):
        resolve(tmp_path, url="https://x/", password_file=name)


def test_neither_a_mistake_in_the_file_nor_a_masked_text_shows_a_secret(tmp_path) -> None:
    name = private_file(tmp_path, 'url = 5\npasword = "hidden"\n')
    with pytest.raises(Exception, match=r"url|pasword") as raised:
        resolve(tmp_path, password_file=name)
    assert "hidden" not in str(raised.value)
    found = resolve(tmp_path, {"HEXACELL_NOTIFY_NIGHT_SHIFT_URL": CHAT})
    assert "hidden" not in repr(found)
    said = f"could not reach {CHAT}: hidden-b was refused; and hidden-d too"
    assert "hidden" not in found.masked(said)
    assert "was refused" in found.masked(said)


def test_nothing_to_send_to(tmp_path) -> None:
    with pytest.raises(UsageError, match="HEXACELL_NOTIFY_NIGHT_SHIFT_URL"):
        resolve(tmp_path)
    with pytest.raises(UsageError, match="control characters"):
        resolve(tmp_path, {"HEXACELL_NOTIFY_NIGHT_SHIFT_URL": "https://\n"})


@pytest.mark.parametrize(
    "url", ["syslog://localhost", "dbus://hidden", "http://[::hidden/", "http://h:hidden/"]
)
def test_an_address_by_which_nothing_is_sent_is_refused_and_not_shown(tmp_path, url) -> None:
    with pytest.raises(UsageError, match="night shift") as raised:
        resolve(tmp_path, {"HEXACELL_NOTIFY_NIGHT_SHIFT_URL": url})
    assert "hidden" not in str(raised.value)


@pytest.mark.parametrize("url", ["tgram://123456789:hidden_token/1", "slack://a/b/c", "ntfys://topic"])
def test_chat_is_accepted_from_there(tmp_path, url) -> None:
    assert resolve(tmp_path, {"HEXACELL_NOTIFY_NIGHT_SHIFT_URL": url}).url == url


@pytest.mark.parametrize("scheme", ["http", "mqtt", "json", "gotify"])
def test_a_name_that_resolves_to_a_link_local_address_gets_nothing(monkeypatch, scheme) -> None:
    found = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("169.254.169.254", 0))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
    monkeypatch.setattr(socket, "create_connection", None)
    monkeypatch.setattr(socket.socket, "connect", None)
    with pytest.raises(NoticeUndelivered, match="link-local"):
        deliver(an_address(f"{scheme}://robots.example/x"), a_notice(), pause=lambda _: None)


@pytest.mark.parametrize("scheme", ["http", "mqtt", "json"])
def test_a_name_that_resolves_otherwise_when_it_is_connected_to_gets_nothing(monkeypatch, scheme) -> None:
    resolve_really, answers = socket.getaddrinfo, cycle(("192.0.2.1", LOOPBACK))

    def resolved(host: str, *rest: Any, **kind: Any) -> Any:
        return resolve_really(next(answers) if host == "robots.example" else host, *rest, **kind)

    monkeypatch.setattr(socket, "getaddrinfo", resolved)
    monkeypatch.setattr(addresses, "METADATA", {ip_address(LOOPBACK)})
    monkeypatch.setenv("no_proxy", "*")
    with broker() as published, webhook() as posted:
        port = published.port if scheme == "mqtt" else address_of(posted.url).port
        url = f"{scheme}://robots.example:{port}/hook"
        with pytest.raises(NoticeUndelivered, match=None if scheme == "json" else "link-local"):
            deliver(an_address(url), a_notice(), pause=lambda _: None)
    assert (posted.bodies, published.published) == ([], [])
