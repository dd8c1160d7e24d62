"""Addresses in a cell file: of notifications and of a shared archive."""

from typing import get_args

import pytest
from pydantic import ValidationError

from hexacell.cell.operation import (
    USUAL_OCCASIONS,
    ArchiveSettings,
    NotificationSettings,
    Occasion,
    OccasionWord,
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


def test_a_word_that_is_no_occasion_is_answered_with_each_that_is_once(load_with) -> None:
    with pytest.raises(FileError) as raised:
        load_with(ONE + 'on = ["fail"]\n')
    for word in get_args(OccasionWord):
        assert str(raised.value).count(f"'{word}'") == 1
    assert str(raised.value).count("alarm") == 1


def test_names_differ(load_with) -> None:
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
