"""Text for configs that were applied, rolled back, or edited: within 80 columns, each number in full."""

from __future__ import annotations

from hexacell.config.change import ConfigVersions, NumberVersions
from hexacell.text.config_changes import versions_text

VERSIONS = ConfigVersions(
    (
        NumberVersions("S1x", "mm", -1234.567891, 0.0, 0.0),
        NumberVersions("l6", "mm", 620.0, 620.25, 999.123456),
        NumberVersions("B2z", "mm", 1.0, 2.0, None),
    ),
    "--- config-before\n+++ config-after\n@@ -1 +1 @@\n-l\n+m\n",
    is_from_written=True,
)


def test_three_versions_stand_side_by_side() -> None:
    lines = versions_text(VERSIONS).splitlines()
    assert [line.split() for line in lines[:4]] == [
        ["number", "before", "written", "now"],
        ["S1x", "-1234.567891", "0.000000", "0.000000"],
        ["l6", "620.000000", "620.250000", "999.123456", "edited", "by", "hand"],
        ["B2z", "1.000000", "2.000000", "unreadable"],
    ]
    assert lines[4] == "The edit since the run wrote it:"
    assert lines[5:] == ["--- config-before", "+++ config-after", "@@ -1 +1 @@", "-l", "+m"]
    assert max(map(len, lines)) <= 80


def test_an_edit_beside_the_geometry_says_so() -> None:
    lines = versions_text(ConfigVersions((), "+x\n", is_from_written=False)).splitlines()
    assert lines == ["No number of the geometry differs.", "The edit since it was before the run:", "+x"]
