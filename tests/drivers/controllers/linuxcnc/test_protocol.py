"""The linuxcncrsh protocol: commands and answers, without a connection."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.controllers import poses
from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.linuxcnc import gcode
from drivers.controllers.linuxcnc import shell_protocol as protocol
from hexacell.kinematics.pose import Pose

WORDS = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1)
LINE_ENDS = st.sampled_from([b"\r\n", b"\n\r", b"\n", b"\r", b"\r\n\r\n", b"\n\r\r\n"])
COORDINATES = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(WORDS, LINE_ENDS)), st.data())
def test_lines_are_split_at_any_line_end_and_any_packet_boundary(lines, data):
    stream = b"".join(line.encode() + end for line, end in lines)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)))))
    buffer = protocol.LineBuffer()
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += buffer.feed(stream[start:end])
    assert found == [line for line, _ in lines]
    assert buffer.rest == ""


@given(st.text())
def test_an_encoded_command_fits_the_server_and_is_one_line(command):
    try:
        line = protocol.encode_command(command)
    except FailedError:
        assert len(command.encode()) > 253 or "\r" in command or "\n" in command
    else:
        assert len(line) <= 255
        assert line.endswith(b"\r\n")
        assert line.count(b"\n") == line.count(b"\r") == 1


@given(st.builds(Pose, *[COORDINATES] * 6), st.floats(0.1, 1e5))
def test_a_timed_move_keeps_pose_and_duration_and_fits_a_line(pose, duration_s):
    words = gcode.timed_move(pose.as_tuple(), duration_s).split()
    letters, values = zip(*((word[0], float(word[1:])) for word in words), strict=True)
    assert "".join(letters) == "GGGGXYZABCF"
    assert values[4:10] == pytest.approx(pose.as_tuple(), abs=1e-7)
    assert 60.0 / values[10] == pytest.approx(duration_s, rel=1e-4)
    protocol.encode_command(f"set mdi {gcode.timed_move(pose.as_tuple(), duration_s)}")


@pytest.mark.parametrize(
    ("codes", "block"),
    [
        ("G0 G17 G40 G21 G90 G94 G54 G49 F0 S0", "G94 G0"),
        ("G1 G17 G40 G21 G90 G94 G54 G49 F250 S0", "G94 G1 F250"),
        ("G80 G17 G40 G21 G90 G94 F0 S0", "G94 G80"),
        ("G1 G90 G93 F3000 S0", "G93 G80"),
        ("G0 G17 G20 G90 G94 F0 S0", "G20 G94 G0"),
        ("G1 G90 G94 F0 S0", "G94 G80"),
        ("G2 G90 G95 F0.5 S0", "G95 G80 F0.5"),
        ("", "G94 G0"),
    ],
)
def test_the_modes_of_before_are_restored_by_one_block(codes, block):
    assert gcode.restoring_block(codes) == block


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_a_timed_move_to_a_pose_that_is_not_finite_is_refused(value):
    with pytest.raises(ValueError, match="not a finite number"):
        gcode.timed_move((0.0, 0.0, 500.0, 0.0, value, 0.0), 1.0)


@pytest.mark.parametrize(
    ("line", "command", "answer"),
    [
        ("SET MDI ACK", "set mdi G0 X1", protocol.Response(accepted=True)),
        ("SET MDI NAK", "set mdi G0 X1", protocol.Response(accepted=False)),
        ("SET NAK", "set mdi G0 X1", protocol.Response(accepted=False)),
        ("SET WAIT_MODE ACK", "set set_wait done", protocol.Response(accepted=True)),
        ("SET MODE ACK", "set mdi G0 X1", None),
        ("set mdi G0 X1", "set mdi G0 X1", None),
        ("MDI ACK", "set mdi G0 X1", None),
        ("GET MDI NAK", "set mdi G0 X1", None),
        ("ESTOP ON", "get estop", protocol.Response(accepted=True, text="ON")),
        ("ERROR OK", "get error", protocol.Response(accepted=True, text="OK")),
        ("ERROR", "get error", protocol.Response(accepted=True, text="")),
        ("ERROR a  b NAK", "get error", protocol.Response(accepted=True, text="a  b NAK")),
        ("error: no", "get error", None),
        ("GET FOO NAK", "get foo", protocol.Response(accepted=False)),
        ("GET NAK", "get foo", protocol.Response(accepted=False)),
        ("JOINT_POS 1 2 3 4 5 6", "get abs_act_pos", None),
        ("get estop", "get estop", None),
        ("SET ESTOP ACK", "get estop", None),
    ],
)
def test_an_answer_is_matched_to_its_command(line, command, answer):
    assert protocol.parse_response(line, command) == answer


def test_explanations_are_no_answers_and_further_positions_of_other_axes() -> None:
    assert (
        protocol.parse_explanation("error: Machine must be 'ON' for SET MDI")
        == "Machine must be 'ON' for SET MDI"
    )
    assert protocol.parse_explanation("ERROR OK") == ""
    assert protocol.parse_explanation("warning: newer") == ""
    assert protocol.parse_positions("1 -2 3.5 4 5 6 7 8") == (1.0, -2.0, 3.5, 4.0, 5.0, 6.0)


@given(st.text() | st.lists(st.floats().map(str)).map(" ".join))
def test_positions_are_six_finite_numbers_or_refused(text):
    try:
        positions = protocol.parse_positions(text)
    except FailedError:
        return
    assert len(positions) == 6
    assert all(abs(position) < float("inf") for position in positions)


def test_the_pose_difference_ignores_full_turns_and_gives_the_largest_components():
    one, other = Pose(1, 2, 3, 180.0, 0.1, 0), Pose(1, 2.5, 2, -180.0, -0.2, 0)
    assert poses.pose_difference(one, other) == pytest.approx((1.0, 0.3))
