"""Protects what may be an address in a cell file: of notifications, an archive, a server, a serial port."""

from typing import get_args

import pytest
from pydantic import ValidationError

from hexacell.cell.devices import GaugeSettings, LinearEncoderSettings
from hexacell.cell.measuring import GuardSettings
from hexacell.cell.operation import (
    USUAL_OCCASIONS,
    ArchiveSettings,
    NotificationSettings,
    Occasion,
    OccasionWord,
    OpcUaSettings,
)
from hexacell.errors import FileError

OPEN_ADDRESSES = [
    "https://host:8443/a/b",
    "mqtts://broker",
    "mailto://host:587?from=a@b&to=c@d",
    "http://user@h/x",
]


def section(**values: str) -> str:
    return "[[notifications]]\n" + "".join(f"{key} = {value}\n" for key, value in values.items())


ONE = section(name='"one"', url='"mqtt://x"')


@pytest.mark.parametrize("url", OPEN_ADDRESSES)
def test_addresses_without_secrets_may_stand_there(url) -> None:
    settings = NotificationSettings(name="one", url=url)
    assert (settings.url, settings.on) == (url, USUAL_OCCASIONS)
    assert Occasion.PASS not in USUAL_OCCASIONS


def test_runs_whose_copy_has_a_masked_address_can_still_be_read() -> None:
    url = "mailto://127.0.0.1:***@example.org&to=night@example.org"
    assert NotificationSettings(name="mail", url=url).url == url


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("https://user:hidden@host/x", "password does not belong"),
        ("https://host/x?token=hidden", "password does not belong"),
        ("mailto://host?to=a@b&pass=hidden", "password does not belong"),
        ("slack://hidden/hidden/hidden", "may have a token"),
        ("host/x", "no address"),
    ],
)
def test_secrets_are_refused_and_not_shown(load_with, url, reason) -> None:
    with pytest.raises(FileError, match=reason) as raised:
        load_with(section(name='"one"', url=f'"{url}"'))
    assert raised.value.line is not None
    assert "hidden" not in str(raised.value)


@pytest.mark.parametrize(
    "settings",
    [
        {"on": []},
        {"on": ["test"]},
        {"on": ["sometimes"]},
        {"topic": "a/#"},
        {"topic": "a/b", "url": "https://x/"},
        {"name": "a/b"},
    ],
)
def test_what_makes_no_sense_is_refused(settings) -> None:
    with pytest.raises(ValidationError):
        NotificationSettings.model_validate({"name": "one", "url": "mqtt://x"} | settings)


def test_a_word_that_is_no_occasion_is_answered_with_each_that_is_and_names_differ(load_with) -> None:
    with pytest.raises(FileError) as raised:
        load_with(ONE + 'on = ["fail"]\n')
    for word in get_args(OccasionWord):
        assert str(raised.value).count(f"'{word}'") == 1
    assert str(raised.value).count("alarm") == 1
    with pytest.raises(FileError, match="the same name"):
        load_with(ONE * 2)


@pytest.mark.parametrize(
    "url", ["postgresql://me@host/cells", "postgresql://host:5433/cells", "postgresql://me@/db?host=/run"]
)
def test_a_database_of_the_archive_is_named(url: str) -> None:
    assert ArchiveSettings(url=url).url == url


@pytest.mark.parametrize(
    ("url", "problem"),
    [
        ("postgresql://me:secret@host/cells", "a password does not belong here"),
        ("postgresql://me@host/cells?password=secret", "a password does not belong here"),
        ("postgresql://host", "no address"),
        ("mysql://host/cells", "no address"),
        ("index.sqlite", "no address"),
    ],
)
def test_any_other_archive_is_refused(url: str, problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        ArchiveSettings(url=url)


BROKEN = ["http://[::1/", "http://host:65536/", "https://host:0/", "mqtt://ho st/", f"http://{'a' * 70}/x"]


@pytest.mark.parametrize("url", [*BROKEN, "http://a@b:hidden@host/", "file:///etc/passwd", "dbus://x"])
def test_an_address_that_is_none_is_a_mistake_with_its_line(load_with, url) -> None:
    with pytest.raises(FileError) as raised:
        load_with(section(name='"one"', url=f'"{url}"'))
    assert raised.value.line is not None
    assert "hidden" not in str(raised.value)


@pytest.mark.parametrize("url", ["postgresql://host:65536/cells", "postgresql://[::1/cells"])
def test_so_is_one_of_an_archive(url) -> None:
    with pytest.raises(ValidationError, match="no address"):
        ArchiveSettings(url=url)


@pytest.mark.parametrize("host", ["[::1", "a b", "a" * 70, ""])
def test_a_host_can_be_one(host) -> None:
    with pytest.raises(ValidationError):
        OpcUaSettings(host=host)


@pytest.mark.parametrize(
    "port", ["spy:///dev/ttyS0?file=cell.toml", "ALT://x", "hwgrep://.*", "socket://h:65536", "rfc2217://h"]
)
def test_a_serial_port_is_a_path_or_a_url_that_only_opens_a_port(port) -> None:
    with pytest.raises(ValidationError):
        GaugeSettings(name="x", axis="x", protocol="sylvac", port=port)
    with pytest.raises(ValidationError):
        GuardSettings(stop_port=port)
    with pytest.raises(ValidationError):
        LinearEncoderSettings(bus={"interface": "slcan", "channel": port})


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "socket://[::1]:4001", "TCPIP0::10.0.0.7::5025::SOCKET"])
def test_any_other_is_accepted(port) -> None:
    assert GaugeSettings(name="x", axis="x", protocol="visa", port=port).port == port


LINK_LOCAL = [
    "169.254.169.254", "[fe80::1]", "[fd00:ec2::254]", "2852039166", "0xa9fea9fe", "0251.0376.0251.0376",
    "169.254.43518", "[::ffff:169.254.169.254]", "100.100.100.200",
]  # fmt: skip


@pytest.mark.parametrize("host", LINK_LOCAL)
def test_a_link_local_address_is_meant_on_purpose_or_refused(host) -> None:
    for url in (f"http://{host}:80/x", f"mailto://mail.example?smtp={host.strip('[]')}&to=a@b"):
        with pytest.raises(ValidationError, match="link-local"):
            NotificationSettings(name="one", url=url)
        assert NotificationSettings(name="one", url=url, link_local=True).url == url
