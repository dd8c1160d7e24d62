"""A webhook gets the notice as JSON; what it refuses, or never answers, is told without secrets."""

import json

import pytest

from hexacell.services.unattended import delivery
from hexacell.services.unattended.delivery import PAUSES_S, deliver
from hexacell.services.unattended.notice import Notice, NoticeUndelivered
from tests.hexacell.services.notify.local_servers import (
    closed_port,
    make_certificate,
    silent_server,
    webhook,
)
from tests.hexacell.services.notify.notices import a_notice, an_address

NOTICE = a_notice()


def test_it_gets_the_whole_notice_and_its_id() -> None:
    with webhook() as server:
        deliver(an_address(server.url, user="someone", password="päss:1"), NOTICE)
    assert Notice.model_validate_json(server.bodies[0]) == NOTICE
    assert json.loads(server.bodies[0])["occasions"] == ["no-pass", "alarm"]
    (headers,) = server.headers
    assert (headers["Content-Type"], headers["Idempotency-Key"]) == ("application/json", NOTICE.id)
    assert headers["Authorization"] == "Basic c29tZW9uZTpww6Rzczox"


def test_a_refusal_is_tried_again_after_pauses_that_grow(monkeypatch) -> None:
    monkeypatch.setattr(delivery, "PAUSES_S", PAUSES_S)
    with webhook() as server:
        answered: list[tuple[int, float]] = []
        server.statuses = [503, 503, 204]
        deliver(
            an_address(server.url),
            NOTICE,
            pause=lambda seconds: answered.append((len(server.bodies), seconds)),
        )
    assert answered == [(1, 1.0), (2, 4.0)]
    assert len({headers["Idempotency-Key"] for headers in server.headers}) == 1
    assert len(server.bodies) == 3


def test_a_refusal_is_told_and_a_password_does_not_follow_a_redirection() -> None:
    with webhook() as server:
        for status in (401, 404, 500):
            server.statuses = [status]
            with pytest.raises(NoticeUndelivered, match=f"answers {status}") as raised:
                deliver(an_address(server.url, token="hidden-token"), NOTICE)
            assert "hidden" not in str(raised.value)
        assert server.headers[0]["Authorization"] == "Bearer hidden-token"
    with webhook() as other, webhook() as server:
        server.statuses, server.location = [307], other.url
        with pytest.raises(NoticeUndelivered, match="answers 307"):
            deliver(an_address(server.url, token="hidden-token"), NOTICE)
    assert other.bodies == []


def test_where_nobody_listens_or_answers_is_told_in_time() -> None:
    url = f"http://127.0.0.1:{closed_port()}/secret-path-7"
    with pytest.raises(NoticeUndelivered, match="refused") as raised:
        deliver(an_address(url, open_url=None), NOTICE)
    assert "secret-path-7" not in str(raised.value)
    with silent_server() as port, pytest.raises(NoticeUndelivered, match=r"not (answer|taken)"):
        deliver(an_address(f"http://127.0.0.1:{port}/"), NOTICE, longest_s=0.2)


def test_with_tls_only_a_trusted_certificate_counts(tmp_path) -> None:
    certificate = make_certificate(tmp_path)
    with webhook(certificate) as server:
        deliver(an_address(server.url, ca_file=certificate.path), NOTICE)
        with pytest.raises(NoticeUndelivered, match="certificate"):
            deliver(an_address(server.url), NOTICE)
        with pytest.raises(NoticeUndelivered, match="No such file"):
            deliver(an_address(server.url, ca_file=tmp_path / "none.pem"), NOTICE)
    assert len(server.bodies) == 1
