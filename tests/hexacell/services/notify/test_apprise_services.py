"""Mail and chat, through apprise, at a real mail server on loopback."""

from __future__ import annotations

import email
import json
import sys
from email import policy

import pytest

from hexacell.services.notify.delivery import deliver
from hexacell.services.notify.notice import NoticeUndelivered
from tests.hexacell.services.notify.local_servers import closed_port, mail_server
from tests.hexacell.services.notify.notices import a_notice, an_address

pytestmark = pytest.mark.filterwarnings("ignore:.imghdr. is deprecated:DeprecationWarning")  # of apprise

NOTICE = a_notice()
LOGIN = ("robot", "hidden-password")


def url_at(port: int) -> str:
    return f"mailto://127.0.0.1:{port}?from=robot@example.org&to=quality@example.org&mode=insecure"


def test_a_mail_has_the_line_and_the_document() -> None:
    with mail_server() as server:
        deliver(an_address(url_at(server.port)), NOTICE)
    (raw,) = server.mails
    mail = email.message_from_bytes(raw, policy=policy.default)
    assert mail["Subject"] == "hexacell: cell 1: no-pass, alarm"
    assert mail["To"] == "quality@example.org"
    body = mail.get_body(("plain", "html"))
    assert body is not None
    assert NOTICE.line in body.get_content()
    (attached,) = mail.iter_attachments()
    assert json.loads(attached.get_content()) == NOTICE.model_dump(mode="json")


def test_a_password_is_sent_and_a_wrong_one_not_shown() -> None:
    with mail_server(LOGIN) as server:
        deliver(an_address(url_at(server.port), user=LOGIN[0], password=LOGIN[1]), NOTICE)
        with pytest.raises(NoticeUndelivered) as raised:
            deliver(an_address(url_at(server.port), user="robot", password="hidden-mistake"), NOTICE)
    assert len(server.mails) == 1
    assert "hidden" not in str(raised.value)


def test_where_nobody_listens_no_secret_is_told() -> None:
    url = f"json://127.0.0.1:{closed_port()}/hidden-token"
    with pytest.raises(NoticeUndelivered) as raised:
        deliver(an_address(url, open_url=None), NOTICE)
    assert "hidden" not in str(raised.value)


def test_an_address_that_apprise_does_not_know() -> None:
    with pytest.raises(NoticeUndelivered, match="does not know") as raised:
        deliver(an_address("pigeon://hidden-token", open_url=None), NOTICE)
    assert "hidden" not in str(raised.value)


@pytest.mark.parametrize(
    ("module", "url", "extra"),
    [("apprise", "mailto://x", "notify"), ("paho.mqtt.client", "mqtt://x", "mqtt")],
)
def test_without_the_extra_it_says_what_to_install(monkeypatch, module, url, extra) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(NoticeUndelivered, match=rf"hexacell\[{extra}\]"):
        deliver(an_address(url), NOTICE)
