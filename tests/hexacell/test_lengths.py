"""Lengths of micrometres are shown in um where mm would show hardly a digit."""

import pytest

from hexacell.lengths import MM, UM, from_to, shown, unit_of
from hexacell.results.run_comparison import ParameterDifference
from hexacell.text.layout import figure_with_u
from hexacell.text.parameters import rows_of_changes
from hexacell.uncertainty.statement import LargestError
from hexacell.verdict.decision import JudgedError


@pytest.mark.parametrize(
    ("sizes", "unit"),
    [
        ((0.012, 0.08), MM),
        ((0.0004, 0.05), MM),
        ((0.0004, 0.003), UM),
        ((0.0, 0.0), MM),
        ((None, 2e-5), UM),
    ],
)
def test_sizes_that_belong_together_have_one_unit(sizes, unit) -> None:
    assert unit_of(*sizes) is unit
    assert unit_of(*sizes, unit="mrad").name == "mrad"


def test_angles_that_would_be_nought_are_in_thousandths() -> None:
    assert unit_of(0.0, 0.004, unit="deg").length(0.004) == "0.004 deg"
    assert unit_of(0.0001, 0.0004, unit="deg").length(0.0004) == "0.40 mdeg"


@pytest.mark.parametrize(
    ("mm", "text"), [(0.15, "0.150 mm"), (0.00042, "0.42 um"), (0.0098, "9.80 um"), (0.0, "0.000 mm")]
)
def test_no_length_but_nought_is_shown_as_nought(mm, text) -> None:
    assert shown(mm) == text


def test_lengths_are_told_with_the_digits_that_count() -> None:
    assert from_to(3.7412, 0.1503, 2) == "3.74 -> 0.150 mm"
    assert from_to(0.0213, 0.00041) == "0.021 mm -> 0.41 um"
    error = JudgedError.of(LargestError(0.0004, 0.003), 0.02, 1.5)
    assert error.sentence("mm") == "0.40 +- 3.00 um (limit 20)"
    coarse = JudgedError.of(LargestError(0.0004, 0.05), 0.3, 1.0)
    assert coarse.sentence("mm") == "0.000 +- 0.050 mm (limit 0.3)"
    assert figure_with_u(0.0004, 0.003) == "0.40 +- 3.00 um"
    (row,) = rows_of_changes([ParameterDifference("l1", "mm", 580.0, 580.00031, 0.0002)])
    assert [row.figure(one) for one in (row.new, row.change, row.sigma)] == [
        "580.00031",
        "0.00031",
        "0.00020",
    ]
