"""Sections of the cell file on operation: archive, OPC UA, reports, unattended runs, notifications."""

import re
from enum import StrEnum
from functools import partial
from typing import Annotated, Literal
from urllib.parse import parse_qs

from pydantic import AfterValidator, field_validator, model_validator

from hexacell.addresses import LINK_LOCAL, address_of, is_link_local
from hexacell.cell.fields import (
    Host,
    Name,
    NotNegative,
    Positive,
    Section,
    Text,
    accepted,
    broken_rule,
    key,
)
from hexacell.errors import UsageError
from hexacell.storage.toml_document import MASK

_POSTGRESQL = re.compile(r"postgresql://(?P<login>[^/@]*@)?[^/@]*/[^/?]+(?P<query>\?.*)?")


def require_archive(url: str) -> None:
    """Refuse what is no address of a shared archive; raises ``UsageError``."""
    write = "Write postgresql://user@host/database"
    if (found := _POSTGRESQL.fullmatch(url)) is None:
        raise UsageError("this is no address of a PostgreSQL database", action=write)
    if ":" in (found["login"] or "") or "password" in (found["query"] or ""):
        raise UsageError("a password does not belong here", action="Put it into ~/.pgpass, and remove it")
    try:
        address_of(url)
    except UsageError as error:
        raise UsageError(error.problem, action=write) from error


class ArchiveSettings(Section):
    """The index over the cell's runs; the runs themselves are in their folders."""

    url: Annotated[Text, AfterValidator(partial(accepted, require=require_archive))] | None = key(
        None,
        "address of an archive that several cells may share, postgresql://user@host/database; without "
        "it, a file beside the runs. A password belongs in the user's ~/.pgpass",
    )


class OpcUaSettings(Section):
    """The server that ``hexacell serve`` starts; its messages are always signed and encrypted."""

    host: Host = key("127.0.0.1", "address that the server listens at")
    port: int = key(4840, "TCP port that the server listens at", ge=1, le=65535)
    folder: Text = key(
        "opcua",
        "folder of the server's certificate and private key, relative to the cell file; made where absent",
        min_length=1,
    )
    password_file: Text | None = key(
        None,
        "TOML file with user and password of who may read, relative to the cell file, which others must "
        "not be able to read. HEXACELL_OPCUA_USER and HEXACELL_OPCUA_PASSWORD in the environment take "
        "precedence",
        min_length=1,
    )
    anonymous: bool = key(False, "whether anybody may read without a password")
    poll_s: float = key(
        2.0, "time between two looks for new runs, s", ge=0.05, le=3600, allow_inf_nan=False
    )


class ScreenSettings(Section):
    """The technician's screen in a browser, as ``hexacell tui --serve`` serves it."""

    password_file: Text | None = key(
        None,
        "TOML file with user and password of who may use it, relative to the cell file, which others must "
        "not be able to read; without one it is for this user on this computer alone. HEXACELL_SCREEN_USER "
        "and HEXACELL_SCREEN_PASSWORD in the environment take precedence",
        min_length=1,
    )


class ReportSettings(Section):
    """What a report of a run says beside what was measured; all of it may be left out."""

    machine: Text = key("", "maker and model of the robot")
    serial_number: Text = key("", "serial number of the robot")
    laboratory: Text = key("", "name and address of who calibrates")
    country: Text = key(
        "", "country of the laboratory, ISO 3166: two letters, as DE", pattern="^([A-Z]{2})?$"
    )
    customer: Text = key("", "name and address of the customer")
    place: Text = key("", "place of the robot")
    authorised_by: Text = key("", "name of who answers for reports of this cell")


DAY_MINUTES = 24 * 60
_SPAN = re.compile(r"([01]\d|2[0-3]):([0-5]\d)-([01]\d|2[0-3]):([0-5]\d)")

Weekday = Literal["mon", "tue", "wed", "thu", "fri", "sat", "sun"]


class UnattendedSettings(Section):
    """Runs without a person: check, quick level or calibration, from a schedule or typed."""

    quiet_hours: tuple[Text, ...] = key(
        (),
        "times in which no run begins and one that goes on ends, as 05:30-22:00, in the computer's time "
        "zone; past midnight as 22:00-06:00",
        max_length=20,
    )
    quiet_days: tuple[Weekday, ...] = key(
        ("mon", "tue", "wed", "thu", "fri", "sat", "sun"), "days on which quiet hours begin"
    )
    window_minutes: NotNegative = key(
        0.0,
        "minutes after its time in which a run that could not begin is tried again; 0: not at all",
        le=DAY_MINUTES,
    )
    retry_minutes: Positive = key(10.0, "minutes between two tries", le=DAY_MINUTES)
    longest_minutes: Positive | None = key(
        None,
        "longest duration of a run, minutes; then it goes back to its reference and ends, and can be "
        "resumed",
    )

    @field_validator("quiet_hours")
    @classmethod
    def _are_spans_of_a_day(cls, spans: tuple[str, ...]) -> tuple[str, ...]:
        for span in spans:
            if _SPAN.fullmatch(span) is None or span[:5] == span[6:]:
                raise broken_rule(f"'{span}' is no span of a day", "Write it as 05:30-22:00")
        return spans

    @property
    def quiet_spans(self) -> tuple[tuple[int, int], ...]:
        """Begin and length of the quiet hours, minutes, from midnight."""
        found = (_SPAN.fullmatch(span) for span in self.quiet_hours)
        clocks = [tuple(int(number) for number in one.groups()) for one in found if one is not None]
        begins_ends = [(60 * a + b, 60 * c + d) for a, b, c, d in clocks]
        return tuple((begin, (end - begin) % DAY_MINUTES) for begin, end in begins_ends)


MOST_NOTIFICATIONS = 10


class Occasion(StrEnum):
    """Why a run without a person is reported; one run may have several reasons."""

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

CHAT_SERVERS = ("gotify", "matrix", "mmost", "nctalk", "ntfy", "rocket", "signal", "synology", "xmpp")
"""Chat that a company may have a server of its own for; with an s where it is encrypted."""

CHAT_SERVICES = (
    *("discord", "feishu", "gchat", "ifttt", "lark", "line", "mailgun", "msteams", "o365", "opsgenie"),
    *("pagerduty", "pbul", "pover", "prowl", "sendgrid", "ses", "signl4", "slack", "sns", "tgram"),
    *("threema", "twilio", "vonage", "webex", "whatsapp", "workflow", "workflows", "wxteams", "zulip"),
)
"""Chat, mail and calls at fixed hosts; what stands in place of a host is a name or a token."""

TOLD_BY = {*WITHOUT_TOKENS, *CHAT_SERVERS, *(f"{name}s" for name in CHAT_SERVERS), *CHAT_SERVICES}
"""All that notices are sent by: what acts on this computer or has its files read is not among them."""

_SECRET_QUERY = re.compile(r"[?&][^=&]*(?:pass|token|secret|key|auth)[^=&]*=", re.IGNORECASE)
_WILD = re.compile(r"[#+\0]")


def scheme_of(url: str) -> str:
    """What stands before ``://`` in an address."""
    return url.partition("://")[0].lower()


def _require_no_secret(url: str) -> None:
    """Refuse an address that may not stand in a cell file; raises ``UsageError``."""
    write = "Write https://host/path, mqtts://host or mailto://host?to=..."
    if "://" in url and (scheme := scheme_of(url)) not in WITHOUT_TOKENS:
        action = "Move url to a file of mode 600, and name it password_file"
        raise UsageError(f"an address of {scheme} may have a token in it", action=action)
    try:
        found = address_of(url)
    except UsageError as error:
        raise UsageError(error.problem, action=write) from error
    if not found.hostname or "#" in url:
        raise UsageError("this is no address", action=write)
    if (found.password or MASK).partition("@")[0] != MASK or _SECRET_QUERY.search(url):
        action = "Move it to a file of mode 600, and name it password_file"
        raise UsageError("a password does not belong here", action=action)


class NotificationSettings(Section):
    """Somebody who is notified of runs without a person."""

    name: Name = key(..., "name of the recipient")
    url: Annotated[Text, AfterValidator(partial(accepted, require=_require_no_secret))] | None = key(
        None,
        "address: https://host/path (webhook, JSON), mqtts://host (MQTT), mailto://host?from=...&to=... "
        "or a chat service's address as apprise has it. One with a token in it belongs in password_file",
    )
    on: tuple[OccasionWord, ...] = key(
        USUAL_OCCASIONS,
        "runs that are reported: no-pass are those with another verdict than a pass, failure those "
        "without one",
    )
    topic: Text | None = key(
        None, "MQTT topic below which the state is kept; by default hexacell/NAME-OF-CELL", min_length=1
    )
    ca_file: Text | None = key(
        None,
        "certificates (PEM) that must have signed a webhook's or broker's, relative to the cell file; by "
        "default those that the computer trusts",
        min_length=1,
    )
    password_file: Text | None = key(
        None,
        "TOML file with any of url, user, password and token, relative to the cell file, which others "
        "must not be able to read. HEXACELL_NOTIFY_NAME_URL, ..._USER, ..._PASSWORD and ..._TOKEN in the "
        "environment take precedence",
        min_length=1,
    )
    link_local: bool = key(
        False,
        "whether url may lead to a link-local address (169.254.0.0/16, fe80::/10) or to the secrets that a "
        "cloud tells its computers",
    )

    @field_validator("on")
    @classmethod
    def _reports_something(cls, on: tuple[OccasionWord, ...]) -> tuple[OccasionWord, ...]:
        if not on:
            raise broken_rule("nothing is reported", "Name an occasion, or remove the section")
        return on

    @field_validator("topic")
    @classmethod
    def _names_one_topic(cls, topic: str | None) -> str | None:
        if topic is not None and (_WILD.search(topic) or topic.startswith("$")):
            raise broken_rule("this is no topic to publish to", "Leave #, + and a first $ away")
        return topic

    @model_validator(mode="after")
    def _leads_elsewhere(self) -> "NotificationSettings":
        hosts = () if self.url is None or self.link_local else hosts_of(self.url)
        if any(is_link_local(host, by_name=False) for host in hosts):
            raise broken_rule(LINK_LOCAL, "Correct it, or write link_local = true beside url on purpose")
        return self

    @model_validator(mode="after")
    def _of_a_broker(self) -> "NotificationSettings":
        if self.topic is not None and self.url is not None and scheme_of(self.url) not in BROKERS:
            raise broken_rule("only MQTT has topics", "Remove topic, or write mqtts://host as the url")
        return self


def require_sendable(url: str) -> None:
    """Refuse an address, wherever it is from, by which no notices are sent; raises ``UsageError``."""
    if scheme_of(url) not in TOLD_BY:
        problem = "notices are not sent by this kind of address"
        raise UsageError(problem, action="Write one that docs/howto-integrations.md names")
    hosts_of(url)


def hosts_of(url: str) -> tuple[str, ...]:
    """The hosts that an address names, as apprise's of mail also do in their query; raises ``UsageError``.

    A service at a fixed host names none.
    """
    if scheme_of(url) in CHAT_SERVICES:
        return ()
    found = address_of(url)
    return (found.hostname or "", *parse_qs(found.query).get("smtp", ()))
