"""Settings written as a cell file read back as the same settings."""

from __future__ import annotations

from typing import Any, get_args

from hypothesis import given, settings
from hypothesis import strategies as st

from hexacell.cell import devices, limits, measuring, model, simulation
from hexacell.cell import robot as controller
from hexacell.cell.by_mechanism import cell_model
from hexacell.cell.loader import describe, dump, schema
from hexacell.cell.robot import DEFAULT_MECHANISM

finite = st.floats(allow_nan=False, allow_infinity=False)
numbers = st.floats(-1e6, 1e6)
positive = st.floats(1e-9, 1e6)
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=12)
printable = st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=12)
points = st.tuples(numbers, numbers, numbers)
six = st.tuples(*[numbers] * 6)
cones = st.floats(1e-9, 180) | st.tuples(*[st.floats(1e-9, 180)] * 6)
signs = st.sampled_from([1, -1])
scalars = st.one_of(st.booleans(), st.integers(), finite, texts)
anything = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3)
)
tables = st.dictionaries(texts, anything, max_size=3)
MODEL = cell_model("hexaglide")
ROBOT: Any = MODEL.model_fields["robot"].annotation
SIMULATION: Any = get_args(MODEL.model_fields["simulation"].annotation)[0]
geometries = st.builds(
    ROBOT.model_fields["nominal"].annotation,
    S=st.tuples(*[points] * 6),
    B=st.tuples(*[points] * 6),
    l=st.tuples(*[positive] * 6),
)


def _gauges(axes: tuple[str, ...]) -> st.SearchStrategy[tuple[Any, ...]]:
    return st.tuples(
        *(
            st.builds(
                devices.GaugeSettings,
                name=st.just(f"gauge {axis}"),
                axis=st.just(axis),
                sign=signs,
                protocol=printable,
                port=st.just(f"/dev/{axis}") if place else st.none() | st.just("loop://"),
                serial=tables,
                channel=st.integers(1, 99),
                timeout_s=positive,
            )
            for place, axis in enumerate(axes)
        )
    )


cells = st.builds(
    MODEL,
    name=st.text(st.characters(categories=["L", "Nd"]), min_size=1, max_size=12),
    robot=st.builds(ROBOT, mechanism=st.just(DEFAULT_MECHANISM), nominal=geometries),
    controller=st.builds(
        controller.ControllerSettings,
        config=printable,
        port=st.none() | st.integers(1, 65535),
        reload_command=st.lists(printable, max_size=3).map(tuple),
    ),
    gauges=st.permutations("xyz").flatmap(lambda axes: _gauges(tuple(axes))),
    encoders=st.builds(
        devices.LinearEncoderSettings,
        bus=st.none() | tables,
        nodes=st.permutations(range(1, 128)).map(lambda ids: tuple(ids[:6])),
        signed=st.booleans(),
        direction=st.tuples(*[signs] * 6),
        offset_mm=six,
        serial_numbers=st.none() | st.tuples(*[st.integers(0, 2**32 - 1)] * 6),
    ),
    limits=st.builds(
        limits.LimitSettings,
        tilt_deg=st.floats(1e-9, 80),
        passive_joints=st.builds(limits.PassiveJointSettings, base_cone_deg=cones, platform_cone_deg=cones),
    ),
    identification=st.builds(
        measuring.IdentificationSettings,
        points=st.lists(points, min_size=2, max_size=4).map(tuple),
        orientations=st.integers(2, 1000),
    ),
    verification=st.builds(
        measuring.VerificationSettings, points=st.lists(points, min_size=1, max_size=2).map(tuple)
    ),
    task=st.builds(
        measuring.TaskSettings,
        poses=st.lists(six, max_size=2).map(tuple),
        work_frame=st.sampled_from(["", "z", "xyz"]),
    ),
    simulation=st.builds(
        SIMULATION,
        geometry=geometries,
        gauges=st.builds(simulation.SimulatedGauges, baudrate=st.none() | st.integers(300, 10**6)),
    ),
)


@settings(max_examples=20)
@given(stated=cells)
def test_settings_dumped_and_described_load_as_the_same(load_text, stated):
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
    assert "window_s = 0.6  # default\n" in text
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
