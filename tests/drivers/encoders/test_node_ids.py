"""The node id of the only device on a bus is set, and of no other."""

from __future__ import annotations

from functools import partial

import pytest

from drivers.discovery import SearchTimeouts, encoders
from drivers.errors import BusError
from hexacell.errors import DeviceError
from tests.drivers.encoders.conftest import LSS_REQUEST

set_node_id = partial(encoders.set_node_id, timeouts=SearchTimeouts(adapter=0.3, node=0.1))


@pytest.fixture
def bus(raw):
    return {"interface": "virtual", "channel": raw.channel}


@pytest.fixture
def alone(raw):
    raw.nodes = {3: raw.nodes[3]}
    return raw


def test_the_only_device_takes_the_id_and_answers_with_it(alone, bus) -> None:
    assert set_node_id(bus, 5) == 3
    assert list(alone.nodes) == [5]
    assert not alone.layer_setting.is_configuring
    requests = [data[0] for can_id, data in alone.heard if can_id == LSS_REQUEST]
    assert requests == [0x04, 0x5A, 0x11, 0x17, 0x04]


def test_a_device_without_an_id_gets_one(raw, bus) -> None:
    raw.nodes, raw.layer_setting.nameless = {}, 1
    assert set_node_id(bus, 7) is None
    assert list(raw.nodes) == [7]


def test_nothing_is_set_where_there_are_several(raw, bus) -> None:
    with pytest.raises(DeviceError, match=r"has several nodes: 1, 2, 3, 4, 5, 6\. Connect the one device"):
        set_node_id(bus, 9)
    assert not any(can_id == LSS_REQUEST for can_id, _ in raw.heard)


def test_one_without_an_id_beside_it_is_counted(alone, bus) -> None:
    alone.layer_setting.nameless = 1
    with pytest.raises(DeviceError, match=r"has 2 devices that answer\. Connect the one device"):
        set_node_id(bus, 5)
    assert list(alone.nodes) == [3]
    assert alone.layer_setting.node is None
    assert not alone.layer_setting.is_configuring


@pytest.mark.parametrize("is_there", [True, False])
def test_what_does_not_know_the_protocol_is_told(alone, bus, is_there: bool) -> None:
    alone.layer_setting.is_known = False
    if not is_there:
        alone.nodes = {}
    with pytest.raises(DeviceError, match="has no device that knows LSS: "):
        set_node_id(bus, 5)


def test_an_id_that_is_refused_is_told_and_the_device_works_on(alone, bus) -> None:
    alone.layer_setting.refusal = 1
    with pytest.raises(DeviceError, match="has a device that refuses node id 5: "):
        set_node_id(bus, 5)
    assert not alone.layer_setting.is_configuring


def test_an_id_that_does_not_hold_is_told(alone, bus) -> None:
    alone.layer_setting.forgets = True
    with pytest.raises(BusError, match="has no node 5 after it was stored"):
        set_node_id(bus, 5)
