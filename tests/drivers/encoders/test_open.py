"""Opening: detection, identification and configuration of the nodes."""

import pytest

from drivers.encoders.cia406 import Cia406Bank
from drivers.errors import BusError, SilentNodeError
from hexacell.cell.devices import LinearEncoderSettings, RotaryEncoderSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.parameters import JointUnit

DIALOGUE_WITH_NODE_4 = """
    8004                enter PRE-OPERATIONAL
    4000100000000000    device type: probe
    4000100000000000    device type
    4005600100000000    measuring step
    4001650000000000    the same elsewhere (not there)
    4018100100000000    vendor
    4018100200000000    product (not there)
    4018100300000000    revision (not there)
    4018100400000000    serial number
    4000600000000000    operating parameters (not there)
    4003600000000000    preset (not there)
    4009650000000000    offset (not there)
    4005650000000000    warnings (not there)
    4005100000000000    SYNC of another identifier (not there)
    4019100000000000    SYNC with a counter (not there)
    4017100000000000    heartbeat
    2b171000fa000000              every 250 ms
    4017100000000000              kept?
    4000180100000000    TPDO1: COB-ID
    40001a0000000000           mapped entries: none
    4000180200000000           transmission type
    4001180100000000    TPDO2: COB-ID
    40011a0000000000           mapped entries: one
    4001180200000000           transmission type
    40011a0100000000           position
    4002180100000000    TPDO3 (not there)
    4003180100000000    TPDO4 (not there)
    2300180184010080    TPDO1 off
    2301180184020080    TPDO2 off
    2f01180201000000    TPDO2 with every SYNC
    4001180500000000          event timer (not there)
    2301180184020000          on
    4001180200000000          kept?
    4001180100000000          on?
    4001100000000000    error register (not there)
    4003650000000000    alarms (not there)
    4005650000000000    warnings (not there)
    0104                start
"""


async def test_the_dialogue_with_a_node_frame_by_frame(raw, make_bank):
    bank = make_bank(heartbeat_ms=250)
    await bank.open()
    await bank.close()
    assert raw.requests_to(4) == [line.split()[0] for line in DIALOGUE_WITH_NODE_4.strip().splitlines()]


async def test_all_nodes_are_configured_before_any_is_started(raw, opened):
    commands = [data.hex() for can_id, data in raw.heard if can_id == 0]
    assert commands == [f"80{node:02x}" for node in range(1, 7)] + [f"01{node:02x}" for node in range(1, 7)]
    first_start = raw.heard.index((0, b"\x01\x01"))
    assert not any(data[0] >> 5 == 1 for can_id, data in raw.heard[first_start:] if can_id >> 7 == 0xC)


KEPT_ELSEWHERE = {(0x6005, 1): None, (0x6501, 0): "e8030000"}
UNFIT = [
    ({(0x1000, 0): "96010200"}, r"is no absolute .*0x00020196 .*an encoder, but of class 2"),
    ({(0x1000, 0): "92010200"}, r"is no absolute .*0x00020192 .*profile 402"),
    ({(0x6005, 1): "88130000"}, r"step of 5000 nm, the cell file says 1000 nm"),
    (KEPT_ELSEWHERE | {(0x6501, 0): "64000000"}, "has a measuring step of 100 nm"),
    ({(0x6005, 1): None}, "has no object 6501h:0"),
    ({(0x1018, 4): None}, r"serial number \(none\), the cell file says 505"),
    ({(0x1018, 4): "4d000000"}, "serial number 77, the cell file says 505"),
    ({(0x1801, 1): None, (0x1800, 1): None}, "no transmit PDO"),
    ({(0x1A01, 0): "02", (0x1A01, 1): "04003060", (0x1A01, 2): "20000460"}, "position 4 bits into TPDO 2"),
    ({(0x1001, 0): "21"}, "1001h:0"),
]
"""Objects of a node, in hexadecimal or not there, and why it is refused."""


def change(node, objects) -> None:
    for key, value in objects.items():
        if value is None:
            del node.objects[key]
        else:
            node.objects[key] = bytes.fromhex(value)


@pytest.mark.parametrize(("objects", "error"), UNFIT)
async def test_a_device_that_does_not_fit_is_refused_by_its_leg(raw, make_bank, objects, error):
    change(raw.nodes[5], objects)
    stated = tuple(500 + leg for leg in range(1, 7))
    bank = make_bank(serial_numbers=stated)
    with pytest.raises(DeviceError, match=rf"leg 5 \(node 5\).*{error}"):
        await bank.open()


FIT = [
    KEPT_ELSEWHERE,
    {(0x6501, 0): "e8030000"},  # the same step twice
    {(0x1001, 0): "10"},  # a communication error that is past
    {(0x1019, 0): "f0"},  # a SYNC with a counter, which is switched off
]


@pytest.mark.parametrize("objects", FIT)
async def test_a_device_that_fits_is_used(raw, bank, objects):
    change(raw.nodes[5], objects)
    await bank.open()
    assert (await bank.read()).counts == (1000, 2000, 3000, 4000, 5000, 6000)
    assert raw.nodes[5].objects.get((0x1019, 0), b"\0") == b"\0"


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ({"answers_sdo": 2}, "two devices share node id 4, .* or it answers late.*timeout_s"),
        ({"answers_sync": lambda _: [bytes(4), bytes(4)]}, "two devices share"),
        ({"answer_sdo": lambda request: b"\x43\x00\x10\x07" + bytes(4)}, "does not respond"),
        ({"refuses": {(0x1801, 2): 0x0601_0002}}, r"object 1801h:2 to 0x1.*read only"),
        ({"forgets": {(0x1801, 2)}}, "acknowledges"),
        ({"forgets": {(0x1801, 1)}}, "acknowledges"),
        ({"forgets": {(0x1005, 0)}}, "acknowledges, but does not keep, object 1005h:0"),
        ({"refuses": {(0x1019, 0): 0x0800_0022}}, r"refuses to set object 1019h:0 to 0x0.*vendor's tool"),
    ],
)
async def test_a_node_that_answers_wrongly_is_named(raw, bank, fault, error):
    node = raw.nodes[4]
    change(node, {(0x1801, 2): "fe", (0x1801, 1): "84020080", (0x1019, 0): "f0", (0x1005, 0): "90000000"})
    for name, value in fault.items():
        setattr(node, name, value)
    with pytest.raises(DeviceError, match=rf"leg 4 \(node 4\).*{error}"):
        await bank.open()


async def test_legs_have_any_nodes_and_missing_ones_are_all_named(raw, make_bank):
    bank = make_bank(nodes=(6, 5, 4, 3, 2, 1), timeout_s=1.0)
    identities = await bank.open()
    assert identities[0].name == "encoder of leg 1 (node 6)"
    assert (await bank.read()).counts == (6000, 5000, 4000, 3000, 2000, 1000)
    del raw.nodes[2], raw.nodes[5]
    with pytest.raises(BusError, match=r"encoders of leg 2 \(node 5\), leg 5 \(node 2\): no device"):
        await bank.open()


async def test_a_node_that_belongs_to_no_leg_is_named(raw, short_timeout_bank):
    raw.nodes[127] = raw.nodes.pop(3)
    raw.nodes[127].node = 127
    with pytest.raises(BusError, match=r"leg 3 \(node 3\).*node 127 is on the bus but belongs to no leg"):
        await short_timeout_bank.open()


async def test_two_steps_that_differ_are_refused_until_the_cell_file_names_one(raw, make_bank):
    for node in raw.nodes.values():
        node.objects[0x6501, 0] = (5000).to_bytes(4, "little")
    words = r"leg 1.*1000 nm in object 6005h:1, 5000 nm in object 6501h:0.*step_object"
    for choice, error in (("any", words), ("6501h", "has a measuring step of 5000 nm"), ("6005h", None)):
        bank = make_bank(step_object=choice)
        if error is None:
            await bank.open()
        else:
            with pytest.raises(DeviceError, match=error):
                await bank.open()


async def test_settings_that_shift_or_turn_counts_belong_to_the_identity(raw, bank):
    node = raw.nodes[4]
    assert (await bank.open())[3].settings == ""
    node.objects[0x6000, 0] = b"\x0c\0"
    node.objects[0x6003, 0] = (500).to_bytes(4, "little")
    node.objects[0x6509, 0] = (-20).to_bytes(4, "little", signed=True)
    found = (await bank.open())[3]
    assert found.settings == "operating parameters reversed, 0x000c, preset 500, offset -20"
    node.objects[0x6000, 0] = b"\x04\0"
    again = (await bank.open())[3]
    assert again.settings == "operating parameters 0x0004, preset 500, offset -20"
    assert again != found


async def test_a_warning_is_told_and_is_no_part_of_the_identity(raw, bank):
    before = await bank.open()
    raw.nodes[2].objects[0x6505, 0] = b"\x04\0"
    now = await bank.open()
    assert now[1].remark == "it reports a warning: object 6505h:0 is 0x0004"
    assert now == before
    await bank.read()


async def test_position_is_mapped_where_no_tpdo_has_it(raw, bank):
    for node in raw.nodes.values():
        node.objects[0x1A01, 0] = b"\0"
        node.objects[0x1A01, 1] = bytes(4)
        node.objects[0x1801, 2] = b"\xff"
        node.objects[0x1A00, 1] = bytes(4)
        node.objects[0x1800, 5] = b"\x01\0"
        node.objects[0x1801, 1] = (0x180 + node.node).to_bytes(4, "little")  # where the raw node sends
    await bank.open()
    assert (await bank.read()).counts == (1000, 2000, 3000, 4000, 5000, 6000)
    assert raw.nodes[1].objects[0x1A00, 1] == bytes.fromhex("20000460")
    assert raw.nodes[1].objects[0x1A00, 0] == b"\x01"
    assert raw.nodes[1].objects[0x1800, 2] == b"\x01"
    assert raw.nodes[1].objects[0x1800, 5] == b"\0\0"
    assert raw.nodes[1].objects[0x1800, 1] == bytes.fromhex("81010000")


async def test_a_node_that_fails_while_being_configured_is_named(raw, short_timeout_bank):
    node, answer = raw.nodes[3], raw.nodes[3].answer_sdo

    def answer_until_tpdo1_is_read(request):
        node.answers_sdo = 0 if request[1:3] == b"\x00\x18" else 1
        return answer(request)

    node.answer_sdo = answer_until_tpdo1_is_read
    with pytest.raises(SilentNodeError, match=r"leg 3 .*1A00h:0"):
        await short_timeout_bank.open()


async def test_a_cell_without_a_bus_is_told():
    with pytest.raises(BusError, match=r"not configured in the cell file.*State `bus` under \[encoders\]"):
        await Cia406Bank(LinearEncoderSettings(bus=None)).open()


def turned_into_rotary(raw, counts: int, place: tuple[int, int] = (0x6001, 0)) -> None:
    for node in raw.nodes.values():
        node.objects[0x1000, 0] = (0x0002_0196).to_bytes(4, "little")
        node.objects[place] = counts.to_bytes(4, "little")
        del node.objects[0x6005, 1]


@pytest.fixture
async def rotary_bank(settings):
    kept = settings.model_dump(exclude={"measuring_step_nm", "step_object", "offset", "signed"})
    bank = Cia406Bank(RotaryEncoderSettings(**kept, counts_per_turn=3600))
    yield bank
    await bank.close()


@pytest.mark.parametrize("place", [(0x6001, 0), (0x6501, 0)])
async def test_encoders_of_angles_show_degrees(raw, rotary_bank, place):
    turned_into_rotary(raw, 3600, place)
    identities = await rotary_bank.open()
    assert identities[0].description.startswith("CiA 406 absolute rotary encoder")
    found = await rotary_bank.read()
    assert found.unit is JointUnit.DEG
    assert found.positions == pytest.approx([100.0 * leg for leg in range(1, 7)])


async def test_other_counts_a_turn_and_encoders_of_lengths_are_refused(raw, bank, rotary_bank):
    with pytest.raises(DeviceError, match="is no absolute rotary encoder"):
        await rotary_bank.open()
    turned_into_rotary(raw, 4096)
    with pytest.raises(DeviceError, match=r"leg 1.*has 4096 counts a turn, the cell file says 3600"):
        await rotary_bank.open()
    with pytest.raises(DeviceError, match="is no absolute linear encoder"):
        await bank.open()
