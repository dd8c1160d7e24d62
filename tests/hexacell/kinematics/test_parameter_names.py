"""Parameters in people's words."""

from __future__ import annotations

import pytest

from hexacell.kinematics.parameter_names import display_name


@pytest.mark.parametrize(
    ("name", "words"), [("l3", "leg 3 length"), ("B3z", "B3 z"), ("S1y", "S1 y"), ("B2z", "B2 z")]
)
def test_a_parameter_in_words(name, words):
    assert display_name(name) == words


@pytest.mark.parametrize(
    ("name", "words"),
    [("B2z", "B2/B3/B5 z"), ("B2y", "B2/B5 y"), ("B3y", "B3 y"), ("l6", "leg 6 length")],
)
def test_one_that_stands_for_several_names_them(hexaglide, name, words):
    assert display_name(name, hexaglide.convention) == words
