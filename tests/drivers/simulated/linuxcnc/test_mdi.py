"""MDI blocks."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.controllers.linuxcnc.protocol import rapid_move
from drivers.simulated.linuxcnc.mdi import BlockError, parse_block
from hexacell.kinematics.pose import Pose

HERE = Pose(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


@given(st.builds(Pose, *[st.floats(-1e4, 1e4)] * 6))
def test_blocks_written_by_the_driver_are_parsed(pose):
    target = parse_block(rapid_move(pose), HERE)
    assert target is not None
    assert target.as_tuple() == pytest.approx(pose.as_tuple(), abs=1e-8)


@pytest.mark.parametrize(
    ("block", "target"),
    [
        ("G0 X10", Pose(10.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
        ("g1 z-.5 c+7. f100", Pose(1.0, 2.0, -0.5, 4.0, 5.0, 7.0)),
        ("G0X2Y3 Z 4", Pose(2.0, 3.0, 4.0, 4.0, 5.0, 6.0)),
        ("B0", Pose(1.0, 2.0, 3.0, 4.0, 0.0, 6.0)),
        ("G21 G90", None),
        ("", None),
    ],
)
def test_missing_words_keep_their_values(block, target):
    assert parse_block(block, HERE) == target


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("G0 X1 X2", "Multiple x words on one line"),
        ("G0 X", "No characters found in reading real value"),
        ("G0 Q1", "Bad character 'q' used"),
        ("G20", "Unknown g code used"),
        ("G999", "G-code out of range"),
        ("hello", "No characters found in reading real value"),
    ],
)
def test_invalid_blocks_are_refused_with_the_error_of_linuxcnc(block, words):
    with pytest.raises(BlockError, match=words):
        parse_block(block, HERE)


@given(st.text())
def test_parsing_any_text_raises_block_errors_only(block):
    try:
        parse_block(block, HERE)
    except BlockError:
        return
