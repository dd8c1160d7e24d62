"""A broker keeps the last notice as the state of the cell."""

import pytest

from hexacell.cell.operation import Occasion
from hexacell.services.unattended.delivery import deliver
from hexacell.services.unattended.notice import Notice, NoticeUndelivered
from tests.hexacell.services.notify.local_servers import broker, make_certificate
from tests.hexacell.services.notify.notices import a_notice, an_address

LOGIN = ("robot", "hidden-password")


def at(port: int, **further):
    return an_address(f"mqtt://127.0.0.1:{port}", **further)


def test_the_last_notice_is_the_retained_state_and_a_test_leaves_it_alone() -> None:
    with broker() as server:
        for number in (1, 2):
            deliver(at(server.port), a_notice(number))
    assert len(server.published) == 2
    assert list(server.retained) == ["hexacell/cell 1/state"]
    assert Notice.model_validate_json(server.retained["hexacell/cell 1/state"]) == a_notice(2)
    with broker() as server:
        deliver(at(server.port), a_notice(occasions=(Occasion.TEST,)))
    ((topic, _, is_retained),) = server.published
    assert (topic, is_retained) == ("hexacell/cell 1/test", False)


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")  # of paho, after a failed handshake
def test_login_and_tls(tmp_path) -> None:
    certificate = make_certificate(tmp_path)
    with broker(certificate, login=LOGIN) as server:
        url = f"mqtts://127.0.0.1:{server.port}"
        deliver(an_address(url, user=LOGIN[0], password=LOGIN[1], ca_file=certificate.path), a_notice())
        with pytest.raises(NoticeUndelivered, match="certificate"):
            deliver(an_address(url, user=LOGIN[0], password=LOGIN[1]), a_notice())
    assert len(server.published) == 1


def test_a_wrong_password_or_no_acknowledgement_is_told_and_nothing_shown() -> None:
    with broker(login=LOGIN) as server, pytest.raises(NoticeUndelivered, match="refuses") as raised:
        deliver(at(server.port, user="robot", password="hidden-mistake"), a_notice())
    assert "hidden" not in str(raised.value)
    assert server.published == []
    with broker(acknowledges=False) as server, pytest.raises(NoticeUndelivered, match=r"acknowledge|taken"):
        deliver(at(server.port), a_notice(), longest_s=0.5)
