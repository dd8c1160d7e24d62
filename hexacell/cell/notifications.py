"""Who is told of the runs that nobody watches: where to, and of which of them."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Literal

from pydantic import Field, field_validator, model_validator

from hexacell.cell.fields import Name, Section, Text, broken_rule
from hexacell.storage.secrets import MASK

MOST_NOTIFICATIONS = 10


class Occasion(StrEnum):
    """What a run without a person may be worth telling for; one run may be of several."""

    PASS = "pass"  # noqa: S105 - a verdict
    NO_PASS = "no-pass"  # noqa: S105 - likewise
    ALARM = "alarm"
    ANSWER_NEEDED = "answer-needed"
    FAILURE = "failure"
    TEST = "test"


OccasionWord = Literal["pass", "no-pass", "alarm", "answer-needed", "failure"]
"""Each of them but a test, as a cell file has it."""

USUAL_OCCASIONS: tuple[OccasionWord, ...] = ("no-pass", "alarm", "answer-needed", "failure")

WEBHOOKS = ("http", "https")
BROKERS = ("mqtt", "mqtts")
WITHOUT_TOKENS = (*WEBHOOKS, *BROKERS, "mailto", "mailtos", "json", "jsons")
"""Addresses that may stand in a cell file; those of chat services have a token in them."""

_ADDRESS = re.compile(r"(?P<scheme>[a-z][a-z0-9+.-]*)://(?P<login>[^/?#@]*@)?[^/?#@]+[^#]*")
_SECRET_QUERY = re.compile(r"[?&][^=&]*(?:pass|token|secret|key|auth)[^=&]*=", re.IGNORECASE)
_WILD = re.compile(r"[#+\0]")


class NotificationSettings(Section):
    """Somebody who is told of runs without a person; several may be."""

    name: Name = Field(description="who or what is told")
    url: Text | None = Field(
        None,
        description="https://host/path (webhook, JSON), mqtts://host (MQTT), mailto://host?from=...&to=... "
        "or a chat service's address as apprise has it. One with a token in it belongs in password_file",
    )
    on: tuple[OccasionWord, ...] = Field(
        USUAL_OCCASIONS,
        description="the runs that are told; no-pass are those with another verdict than a pass, failure "
        "those without one",
    )
    topic: Text | None = Field(
        None, min_length=1, description="MQTT: below which state is kept; by default hexacell/NAME-OF-CELL"
    )
    ca_file: Text | None = Field(
        None,
        min_length=1,
        description="certificates (PEM) that must have signed a webhook's or broker's, relative to the "
        "cell file; by default those that the computer trusts",
    )
    password_file: Text | None = Field(
        None,
        min_length=1,
        description="TOML file with any of url, user, password and token, relative to the cell file, which "
        "others must not be able to read. HEXACELL_NOTIFY_NAME_URL, ..._USER, ..._PASSWORD and ..._TOKEN "
        "in the environment take precedence",
    )

    @field_validator("url")
    @classmethod
    def _has_no_secret(cls, url: str | None) -> str | None:
        mistake = None if url is None else mistake_in_address(url)
        if mistake is not None:
            raise broken_rule(*mistake)
        return url

    @field_validator("on")
    @classmethod
    def _tells_something(cls, on: tuple[OccasionWord, ...]) -> tuple[OccasionWord, ...]:
        if not on:
            raise broken_rule("nothing is told", "Name an occasion, or remove the section")
        return on

    @field_validator("topic")
    @classmethod
    def _names_one_topic(cls, topic: str | None) -> str | None:
        if topic is not None and (_WILD.search(topic) or topic.startswith("$")):
            raise broken_rule("this is no topic to publish to", "Leave #, + and a first $ away")
        return topic

    @model_validator(mode="after")
    def _of_a_broker(self) -> NotificationSettings:
        if self.topic is not None and self.url is not None and scheme_of(self.url) not in BROKERS:
            raise broken_rule("only MQTT has topics", "Remove topic, or write mqtts://host as the url")
        return self


def scheme_of(url: str) -> str:
    """What stands before ``://`` in an address."""
    return url.partition("://")[0].lower()


def mistake_in_address(url: str) -> tuple[str, str] | None:
    """What is wrong with an address in a cell file, and what to do; none if nothing is."""
    found = _ADDRESS.fullmatch(url)
    if found is None:
        return "this is no address", "Write https://host/path, mqtts://host or mailto://host?to=..."
    login = found["login"] or ""
    if (":" in login and not login.endswith(f":{MASK}@")) or _SECRET_QUERY.search(url):
        return "a password does not belong here", "Move it to a file of mode 600, and name it password_file"
    if found["scheme"] not in WITHOUT_TOKENS:
        return (
            f"an address of {found['scheme']} may have a token in it",
            "Move url to a file of mode 600, and name it password_file",
        )
    return None
