"""The simulated LinuxCNC takes MDI blocks as the real one does, and refuses the same."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.controllers.linuxcnc.gcode import restoring_block, timed_move
from drivers.simulated.linuxcnc.mdi import BlockError, ModalState, parse_block
from hexacell.kinematics.pose import Pose

HERE = Pose(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


@pytest.mark.parametrize("modes", [ModalState(), ModalState(1, 94, 250.0), ModalState(80, 93)])
def test_the_driver_restores_the_modes_of_before(modes):
    moved = parse_block(timed_move(HERE.as_tuple(), 1.0), HERE, modes)
    assert moved.modes == ModalState(1, 93, 0.0)
    assert parse_block(restoring_block(modes.codes), HERE, moved.modes).modes == modes


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
    assert parse_block(block, HERE).target == target


@pytest.mark.parametrize(
    ("block", "duration_s"),
    [
        ("G0 X10 F30", None),
        ("G1 X11 F60", 10.0),
        ("G1 A14 F60", 10.0),
        ("G93 G1 X11 F30", 2.0),
        ("F30 G93 G1 A14", 2.0),
    ],
)
def test_a_move_lasts_as_its_feed_or_inverse_time_says(block, duration_s):
    assert parse_block(block, HERE).duration_s == duration_s


def test_offsets_move_every_target_but_one_in_machine_coordinates():
    here = Pose(100.0, 0.0, 550.0, 0.0, 0.0, 0.0)
    shifted = ModalState(offset=(10.0, 0.0, 0.0, 0.0, 0.0, 5.0))
    moved = parse_block("G0 X20 C1", here, shifted).target
    assert moved == Pose(30.0, 0.0, 550.0, 0.0, 0.0, 6.0)
    assert parse_block("G53 G0 X20 C1", here, shifted).target == Pose(20.0, 0.0, 550.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("G0 X1 X2", "Multiple x words on one line"),
        ("G0 X", "No characters found in reading real value"),
        ("G0 Q1", "Bad character 'q' used"),
        ("G20", "Unknown g code used"),
        ("G999", "G-code out of range"),
        ("hello", "No characters found in reading real value"),
        ("G93 G1 X10", "F word missing with inverse time g1 move"),
        ("G1 X10", "Cannot do g1 with zero feed rate"),
        ("G93 G94", "Two g codes used from same modal group"),
        ("G94 G1", "Cannot do g1 with zero feed rate"),
        ("G93 G1", "F word missing with inverse time g1 move"),
        ("G80 X1", "Cannot use axis values without a g code that uses them"),
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
