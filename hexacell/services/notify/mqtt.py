"""A notice to an MQTT broker: its JSON as the retained state of the cell's topic, MQTT 3.1.1, QoS 1."""

from __future__ import annotations

import ssl
import threading
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from hexacell.cell.notifications import Occasion
from hexacell.services.notify.address import NoticeAddress
from hexacell.services.notify.notice import Notice
from hexacell.services.notify.undelivered import NoticeUndelivered

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
    url = urlsplit(address.url)
    is_test = Occasion.TEST in notice.occasions
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
    if urlsplit(address.url).scheme == "mqtts":
        try:
            client.tls_set_context(
                ssl.create_default_context(cafile=None if address.ca_file is None else str(address.ca_file))
            )
        except OSError as error:
            raise NoticeUndelivered(f"{address.ca_file}: {error.strerror or error}") from error
    return client, answered, answer
