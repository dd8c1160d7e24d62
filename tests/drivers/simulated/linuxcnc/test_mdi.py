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
def test_moves_of_the_driver_are_parsed(pose):
    target = parse_block(rapid_move(pose), HERE)
    assert target.as_tuple() == pytest.approx(pose.as_tuple(), abs=1e-8)


@pytest.mark.parametrize(
    ("block", "target"),
    [
        ("G0 X10", Pose(10.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
        ("g0 z-.5 c+7.", Pose(1.0, 2.0, -0.5, 4.0, 5.0, 7.0)),
        ("G0X2Y3 Z 4", Pose(2.0, 3.0, 4.0, 4.0, 5.0, 6.0)),
        ("G0 B0", Pose(1.0, 2.0, 3.0, 4.0, 0.0, 6.0)),
    ],
)
def test_missing_words_keep_their_values(block, target):
    assert parse_block(block, HERE) == target


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("G0 X", "No characters found in reading real value"),
        ("G20", "Unknown g code used"),
    ],
)
def test_other_blocks_are_refused(block, words):
    with pytest.raises(BlockError, match=words):
        parse_block(block, HERE)


@given(st.text())
def test_no_other_error_is_raised(block):
    try:
        parse_block(block, HERE)
    except BlockError:
        return
