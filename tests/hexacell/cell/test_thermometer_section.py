"""``[[thermometers]]``: none, one or several, each with its own name."""

import pytest

from hexacell.cell.loader import describe

ROOM = '\n[[thermometers]]\nname = "room"\npath = "/sys/class/hwmon/hwmon0/temp1_input"\n'


def test_settings_of_a_thermometer(load_text, cell_text) -> None:
    rails = ROOM.replace("room", "rails") + 'protocol = "laser"\ntimeout_s = 0.5\n'
    cell = load_text(cell_text + ROOM + rails)
    room, other = cell.settings.thermometers
    assert (room.name, room.protocol, room.timeout_s) == ("room", "sysfs", 2.0)
    assert (other.name, other.protocol, other.timeout_s) == ("rails", "laser", 0.5)
    assert load_text(describe(cell)).settings == cell.settings


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (ROOM + ROOM, "two thermometers have the same name"),
        (ROOM.replace("path", "file"), "'path'"),
        (ROOM.replace("room", ""), "text that is not empty"),
        (ROOM + "legs = [7]\n", "legs"),
        (ROOM + "legs = [4, 4]\n", "two thermometers are on the same leg"),
        (ROOM + "legs = [4]\n" + ROOM.replace("room", "other") + "legs = [4]\n", "on the same leg"),
    ],
)
def test_mistakes_are_reported_with_their_line(refusal, cell_text, section: str, words: str) -> None:
    refusal(cell_text + section, words, len(cell_text.splitlines()) + 1)
