"""Settings written as a cell file read back as the same settings."""

from hypothesis import given, settings
from hypothesis import strategies as st

from hexacell.cell import model
from hexacell.cell.loader import describe, dump, schema
from tests.small_cell import changed

texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=12)
printable = st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=12)
scalars = st.one_of(st.booleans(), st.integers(), st.floats(allow_nan=False, allow_infinity=False), texts)
anything = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3)
)
numbers = st.floats(-1e6, 1e6)
six = st.tuples(*[numbers] * 6)
changes = st.fixed_dictionaries(
    {
        "name": st.text(st.characters(categories=["L", "Nd"]), min_size=1, max_size=12),
        "robot.nominal.S": st.tuples(*[st.tuples(numbers, numbers, numbers)] * 6),
        "robot.nominal.l": st.tuples(*[st.floats(1e-9, 1e6)] * 6),
        "controller.config": printable,
        "controller.port": st.none() | st.integers(1, 65535),
        "controller.reload_command": st.lists(printable, max_size=3).map(tuple),
        "encoders.bus": st.none() | st.dictionaries(texts, anything, max_size=3),
        "encoders.direction": st.tuples(*[st.sampled_from([1, -1])] * 6),
        "encoders.offset": six,
        "encoders.serial_numbers": st.none() | st.tuples(*[st.integers(0, 2**32 - 1)] * 6),
        "limits.tilt_deg": st.floats(1e-9, 80),
        "limits.passive_joints.base_cone_deg": st.floats(1e-9, 180)
        | st.tuples(*[st.floats(1e-9, 180)] * 6),
        "task.poses": st.lists(six, max_size=2).map(tuple),
        "task.work_frame": st.sampled_from(["", "z", "xyz"]),
    }
)


@settings(max_examples=15)
@given(changes=changes)
def test_settings_dumped_and_described_load_as_the_same(load_text, cell_text, changes):
    stated = changed(load_text(cell_text).settings, changes)
    cell = load_text(dump(stated))
    assert cell.settings == stated
    assert load_text(describe(cell)).settings == stated


def test_dump_of_a_real_cell_needs_no_simulation(load_text, cell_text):
    real = load_text(
        cell_text[: cell_text.index("[simulation]")]
        .replace('axis = "', 'port = "socket://127.0.0.1:1"\naxis = "', 1)
        .replace('axis = "y"', 'axis = "y"\nport = "/dev/ttyUSB1"')
        .replace(
            'axis = "z"', 'axis = "z"\nport = "/dev/ttyUSB2"\nserial = {baudrate = 4800, parity = "E"}'
        )
        .replace(
            "nodes =", 'bus = {interface = "slcan", channel = "/dev/ttyACM0", bitrate = 500000}\nnodes ='
        )
        .replace("config_format", "port = 5007\nconfig_format")
    ).settings
    text = dump(real)
    assert "simulation" not in text
    assert 'bus = {interface = "slcan", channel = "/dev/ttyACM0", bitrate = 500000}' in text
    assert load_text(text).settings == real


def test_description_has_the_origin_of_every_value(load_text, cell_text, line_with):
    text = describe(load_text(cell_text))
    assert f"tilt_deg = 45.0  # line {line_with('tilt_deg')}\n" in text
    assert "interval_s = 0.1  # default\n" in text
    assert "# port is not set\n" in text
    values = [line for line in text.splitlines() if "=" in line and not line.startswith("#")]
    assert all("  # " in line or line.endswith("[") for line in values)


def test_schema_names_every_section_and_describes_every_key():
    document = schema()
    assert set(document["properties"]) == set(model.CellSettings.model_fields)
    undescribed = [
        (name, key)
        for name, section in document["$defs"].items()
        for key, field in section["properties"].items()
        if "description" not in field and "$ref" not in str(field)
    ]
    assert undescribed == []


def test_schema_refuses_unknown_keys():
    assert all(section["additionalProperties"] is False for section in schema()["$defs"].values())
