"""Reading a cell file: what it gives, and every way in which it can be wrong."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.loader import load_cell
from hexacell.errors import ExitCode, FileError, HexacellError, SeveralErrors


@pytest.mark.parametrize("name", ["sub/robot.toml", "/etc/robot.toml"])
def test_config_is_beside_the_cell_file_or_at_an_absolute_path(load_changed, cell_path, name):
    cell = load_changed(("simulated-hexaglide.controller.toml", name))
    assert cell.config_path == cell_path.parent / name


def test_windows_line_ends_and_byte_order_mark(load_text, cell_text):
    cell = load_text("\ufeff" + cell_text.replace("\n", "\r\n"))
    assert cell.settings == load_text(cell_text).settings


def test_absent_file_is_named(tmp_path):
    with pytest.raises(FileError, match="not exist") as refused:
        load_cell(tmp_path / "cell.toml")
    assert refused.value.subject == str(tmp_path / "cell.toml")


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_other_encodings_are_refused(cell_text, tmp_path, encoding):
    path = tmp_path / "cell.toml"
    path.write_bytes(cell_text.replace("Hexaglide", "Hexaglide Süd").encode(encoding))
    with pytest.raises(FileError, match="UTF-8") as refused:
        load_cell(path)
    assert refused.value.line == 1


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("[limits]", "[limits", "']'"),
        ("tilt_deg = 45.0", "tilt_deg = ", "Invalid value"),
        ("tilt_deg = 45.0", "tilt_deg 45.0", "'='"),
        ("tilt_deg = 45.0", "tilt_deg = 45.0\ntilt_deg = 45.0", "defined twice"),
        ("[limits]", "[noise]", "defined twice"),
    ],
)
def test_toml_mistakes_have_a_line(load_changed, line_with, old, new, problem):
    with pytest.raises(FileError, match=f"not valid TOML.*{problem}") as refused:
        load_changed((old, new))
    assert refused.value.line == line_with(old) + new.count("\n")


# What stands in the good file, what replaces it, and what must be said about it, in its line.
TILT, NAME, POINT = "tilt_deg = 45.0", 'name = "simulated-hexaglide"', "  [0.0, 155.0, 0.0],"
MISTAKES = [
    (TILT, "tilt_degs = 45.0", r"unknown key 'tilt_degs' in \[limits\]. Did you mean 'tilt_deg'\?"),
    (TILT, "Tilt_Deg = 45.0", r"Did you mean 'tilt_deg'\?"),
    (TILT, "clock_factor = 1", r"unknown key 'clock_factor' .*It belongs in \[timing\]"),
    (TILT, "qqq = 1", r"unknown key 'qqq'.*Known here: gauge_travel_mm, tilt_deg"),
    ('axis = "z"', 'axsi = "z"\naxis = "z"', r"'axsi' in \[\[gauges\]\] number 3. Did you mean 'axis'\?"),
    ("[limits]", "[limit]", r"unknown section 'limit' at the top of the file. Did you mean 'limits'\?"),
    (TILT, 'tilt_deg = "45"', r"is the text \"45\", but must be a number. Remove the quotes"),
    (TILT, 'tilt_deg = "wide"', r"is the text \"wide\", but must be a number. Correct it"),
    (TILT, "tilt_deg = true", "is true, but must be a number"),
    (TILT, "tilt_deg = {}", "is a section, but must be a number"),
    (TILT, "tilt_deg = 80.1", "is 80.1, but must be 80 or less"),
    (TILT, "tilt_deg = 0", "is 0, but must be more than 0"),
    (TILT, "tilt_deg = nan", "is nan, but must be a finite number"),
    (TILT, f"tilt_deg = 1{'0' * 400}", "but must be a finite number"),
    ("joint_min_mm = -800.0", "joint_min_mm = 800.0", "joint_min_mm must be below joint_max_mm"),
    ("version = 1", "version = 2", "'version' at the top of the file is 2, but must be 1"),
    (NAME, 'name = ""', "but must be text that is not empty"),
    (NAME, 'name = "../../.."', "but must be a name of letters, digits"),
    (NAME, 'name = "a\\u001b[2J"', "but must be a name of letters, digits"),
    (NAME, f'name = "{5000 * "a"}"', "but must be text of 64 letters or fewer"),
    ('axis = "z"', 'axis = "u"', r"\[\[gauges\]\] number 3 is the text \"u\", but must be 'x', 'y' or 'z'"),
    ("orientations = 17", "orientations = 17.0", "is 17.0, but must be a whole number"),
    ("orientations = 17", "orientations = 1000000000000000000000000", "but must be 1000 or less"),
    ("nodes = [1, 2, ", "nodes = [1, 200, ", r"\[encoders\], number 2 is 200, but must be 127 or less"),
    ("nodes = [1, 2, ", "nodes = [2, 2, ", "two encoders have the same node id"),
    ("nodes = [1, 2, ", "nodes = [1, ", "is a list of 5 items, but must be a list of 6 items"),
    (POINT, "  [0.0, 155.0],", r"'S' in \[robot.nominal\], row 3 is a list of 2 items, but must be"),
    (POINT, "  [0.0, inf, 0],", "row 3, number 2 is inf, but must be a finite number"),
    (POINT, "  [0.0, 1e308, 0],", "number 2 is 1e.308, but must be a number within"),
    ('protocol = "cdi"', 'protocol = "cdi"\nserial = 3', "is 3, but must be a table"),
    ("encoder_mm = 0.01", "encoder_mm = 1e-320", "but must be more than 0: from 1e-09 to 1e.06"),
    ("gauge_scale = 0.0", "gauge_scale = 1e-320", "but must be 0 or more: 0, or from 1e-09 to 1e.06"),
    ("l = [590.0,", "l = [-590.0,", "'l' in .robot.nominal., number 1 is -590.0, but must be more than 0"),
    ('mechanism = "hexaglide"', "mechanism = 1979-05-27", "'mechanism' in .robot. is a date or a time"),
    ('config = "', 'config = "a\\u0000', "but must be text without control characters"),
    *(
        ("base_cone_deg = 45.0", f"base_cone_deg = {cones}", "'base_cone_deg' .* one a leg")
        for cones in ("180.1", '"wide"', "[45.0]", "[1, 2, 3, 4, 5, 0]", "[[1]]")
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES)
def test_every_mistake_is_named_with_its_line(load_changed, line_with, old, new, message):
    with pytest.raises(FileError, match=message) as refused:
        load_changed((old, new))
    mistake = refused.value
    first_line_of_section = line_with("[limits]") if "joint_min_mm must" in message else line_with(old)
    added = new.count("\n") if message.endswith("a table") else 0
    assert mistake.line == first_line_of_section + added
    assert mistake.action
    assert mistake.exit_code is ExitCode.USAGE


@pytest.mark.parametrize("value", ["nan", "[1.0, inf]", "{a = -inf}", "2020-02-02", "07:30:00"])
def test_serial_settings_are_finite_numbers_or_plain_values(load_changed, value):
    with pytest.raises(FileError, match=r"must be a (finite )?number"):
        load_changed(('protocol = "cdi"', f'protocol = "cdi"\nserial.extra = {value}'))


@pytest.mark.parametrize(
    ("removed", "message", "header"),
    [
        ('config = "simulated-hexaglide.controller.toml"', "'config' in [controller]", "[controller]"),
        ('axis = "z"', "'axis' in [[gauges]] number 3", 'name = "z"'),
    ],
)
def test_missing_key_names_its_section(load_changed, line_with, removed, message, header):
    with pytest.raises(FileError, match=re.escape(f"{message} is missing")) as refused:
        load_changed((removed, ""))
    assert refused.value.line == line_with(header) - (header[0] != "[")


def test_empty_file_misses_every_section_at_once(load_text):
    with pytest.raises(SeveralErrors) as refused:
        load_text("")
    assert "the section [identification] is missing. Add it, with points" in str(refused.value)
    assert "the section [[gauges]] is missing. Add it, with name, axis, protocol" in str(refused.value)
    assert len(refused.value.errors) == 7


def test_two_gauges_are_too_few(load_text, cell_text):
    start, end = cell_text.index('[[gauges]]\nname = "z"'), cell_text.index("[encoders]")
    with pytest.raises(FileError, match="list of 2 items, but must be 3 sections"):
        load_text(cell_text[:start] + cell_text[end:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([('axis = "z"', 'axis = "x"')], "x, y and z, one each"),
        ([('"z"', '"x"')], "same name"),
        (
            [
                ('"sylvac"', '"mux10"\nport = "/dev/a"'),
                ('protocol = "mux10"   ', 'protocol = "mux10"\nport = "/dev/a"'),
            ],
            "same port and channel",
        ),
    ],
)
def test_gauges_with_a_repeated_axis_name_or_channel_are_refused(load_changed, line_with, changes, message):
    with pytest.raises(FileError, match=message) as refused:
        load_changed(*changes)
    assert refused.value.line == line_with("[[gauges]]")


def test_real_cell_needs_a_way_to_every_device(load_text, cell_text, line_with):
    with pytest.raises(SeveralErrors) as refused:
        load_text(cell_text[: cell_text.index("[simulation]")])
    found = [(error.line, error.problem.split(";")[0]) for error in _file_errors(refused.value)]
    first_gauge = line_with("[[gauges]]")
    assert found[:2] == [
        (line_with("[controller]"), "the controller has no port"),
        (first_gauge, "the gauge has no port"),
    ]
    assert found[-1] == (line_with("[encoders]"), "the encoders have no bus")
    assert len(found) == 5


@pytest.mark.parametrize(
    ("encoders", "is_enough"),
    [
        ('protocol = "controller"', True),
        ('protocol = "modbus"\nmodbus = {{ port = "/dev/a", registers = {registers} }}', True),
        ('protocol = "modbus"\nmodbus = {{ registers = {registers} }}', False),
    ],
)
def test_encoders_without_a_bus_say_otherwise_where_they_are(load_text, cell_text, encoders, is_enough):
    text = cell_text[: cell_text.index("[simulation]")]
    stated = encoders.format(registers=list(range(0, 12, 2)))
    with pytest.raises(SeveralErrors) as refused:
        load_text(text.replace('protocol = "cia406"', stated))
    problems = [error.problem for error in _file_errors(refused.value)]
    assert any("the encoders have no bus" in problem for problem in problems) is not is_enough


def test_several_mistakes_come_together_in_the_order_of_the_file(load_changed, cell_path):
    with pytest.raises(SeveralErrors) as refused:
        load_changed(
            ("seed = 1", "sead = 1"), ("tilt_deg = 45.0", "tilt_deg = nan"), ("S_mm = 7.0", "S_mm = -7")
        )
    lines = [error.line for error in _file_errors(refused.value)]
    assert len(lines) == 3
    assert lines == sorted(lines, key=lambda line: line or 0)
    assert str(refused.value).startswith(f"{cell_path} has 3 mistakes:\n  - {cell_path}:")
    assert refused.value.exit_code is ExitCode.USAGE


def _file_errors(several: SeveralErrors) -> list[FileError]:
    assert all(isinstance(error, FileError) for error in several.errors)
    return [error for error in several.errors if isinstance(error, FileError)]


@given(data=st.data())
def test_values_of_any_kind_in_any_place_give_plain_errors_only(cell_text, load_text, data):
    lines = cell_text.splitlines()
    keys = [number for number, line in enumerate(lines) if re.match(r"\w+ = [^\[]*$", line)]
    number = data.draw(st.sampled_from(keys))
    value = data.draw(
        st.sampled_from(
            ['""', "'x'", "0", "-1", "1e400", "true", "[]", "{}", "[[]]", "{a=[1]}", "1979-05-27", "nan"]
        )
    )
    lines[number] = lines[number].split("=")[0] + "= " + value
    try:
        load_text("\n".join(lines))
    except HexacellError as error:
        mistakes = error.errors if isinstance(error, SeveralErrors) else [error]
        assert all(isinstance(mistake, FileError) and mistake.line for mistake in mistakes)
