"""Mail and chat by apprise say the result, and no refusal shows a password."""

import email
import json
import sys
from email import policy
from unittest.mock import MagicMock

import pytest

from hexacell.services.unattended.delivery import deliver
from hexacell.services.unattended.notice import NoticeUndelivered
from tests.hexacell.services.notify.local_servers import closed_port, webhook
from tests.hexacell.services.notify.notices import a_notice, an_address

pytestmark = pytest.mark.filterwarnings("ignore:.imghdr. is deprecated:DeprecationWarning")  # of apprise

NOTICE = a_notice()


def test_a_mail_has_the_line_and_the_document(monkeypatch) -> None:
    server = MagicMock()
    server.return_value.sendmail.return_value = {}  # nobody is refused
    monkeypatch.setattr("smtplib.SMTP", server)
    url = "mailto://127.0.0.1:25?from=robot@example.org&to=quality@example.org&mode=insecure"
    deliver(an_address(url), NOTICE)
    raw = server.return_value.sendmail.call_args.args[2]
    mail = email.message_from_string(raw, policy=policy.default)
    assert mail["Subject"] == "hexacell: cell 1: no-pass, alarm"
    assert mail["To"] == "quality@example.org"
    body = mail.get_body(("plain", "html"))
    assert body is not None
    assert NOTICE.line in body.get_content()
    (attached,) = mail.iter_attachments()
    assert json.loads(attached.get_content()) == NOTICE.model_dump(mode="json")


def test_a_refusal_shows_no_password() -> None:
    with webhook() as server:
        server.statuses = [401]
        url = server.url.replace("http", "json")
        with pytest.raises(NoticeUndelivered) as raised:
            deliver(an_address(url, user="robot", password="hidden-password"), NOTICE)
    assert "hidden" not in str(raised.value)
    assert server.headers[0]["Authorization"].startswith("Basic ")


@pytest.mark.parametrize(
    ("url", "why"), [("json://127.0.0.1:{port}/hidden-x", None), ("pigeon://hidden-token", "does not know")]
)
def test_where_nobody_is_reached_no_secret_is_told(url: str, why: str | None) -> None:
    with pytest.raises(NoticeUndelivered, match=why) as raised:
        deliver(an_address(url.format(port=closed_port()), open_url=None), NOTICE)
    assert "hidden" not in str(raised.value)


@pytest.mark.parametrize(
    ("module", "url", "extra"),
    [("apprise", "mailto://x", "notify"), ("paho.mqtt.client", "mqtt://x", "mqtt")],
)
def test_without_the_extra_it_says_what_to_install(monkeypatch, module, url, extra) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(NoticeUndelivered, match=rf"hexacell\[{extra}\]"):
        deliver(an_address(url), NOTICE)
