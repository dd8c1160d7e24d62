"""A picture in characters has every point where its numbers are, and round numbers at its ends."""

from hexacell.text.screens.views import PlotView, Series, plot_lines


def view(**changes: object) -> PlotView:
    series = Series("so far", "o", ((1.0, 1.0), (2.0, 3.0), (15.0, 2.0)))
    return PlotView(**{"title": "t", "x_label": "pose", "series": (series,)} | changes)  # type: ignore[arg-type]


def test_every_point_is_where_its_numbers_are_and_a_level_is_a_line_below() -> None:
    lines = plot_lines(view(level=2.0), 20, 9)
    assert [line for line in lines if "----o" in line] == ["     2|------------o"]
    assert plot_lines(view(), 40, 9) == [
        "     3|  o                              ",
        "      |                                 ",
        "      |                                 ",
        "     2|                                o",
        "      |                                 ",
        "      |                                 ",
        "     1|o                                ",
        "      +---------------------------------",
        "       1             pose             15",
    ]


def test_logarithms_have_round_numbers_at_both_ends() -> None:
    series = Series("", "o", ((1.0, 36.4), (2.0, 0.56), (3.0, 0.062)))
    lines = plot_lines(view(series=(series,), is_logarithmic=True), 30, 12)
    assert lines[0].startswith("    50|")
    assert lines[9].startswith("  0.05|")


def test_without_room_nothing_is_drawn() -> None:
    assert (
        plot_lines(view(), 15, 9) == plot_lines(view(), 40, 4) == plot_lines(view(series=()), 40, 9) == []
    )


def test_one_point_has_axes_too() -> None:
    series = Series("", "o", ((5.0, 0.2),))
    for is_logarithmic in (False, True):
        lines = plot_lines(view(series=(series,), is_logarithmic=is_logarithmic), 30, 8)
        assert sum(line.count("o") for line in lines) - lines[-1].count("o") == 1
