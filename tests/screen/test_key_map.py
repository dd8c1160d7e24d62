"""Keys that a person chose: taken over everywhere, and mistakes in the file named."""

from pathlib import Path

import pytest

from hexacell.errors import FileError
from hexacell.screen.preferences import KEYS, ScreenPreferences, preferences_path, read_preferences
from procedures.engine.commands import Pause
from tests.screen.conftest import settled
from tests.screen.test_job import workplace_of
from tests.screen.told_run import ToldRun
from tests.waiting import until


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "screen.toml"


def test_keys_and_theme_are_read(path: Path) -> None:
    assert read_preferences(path) == ScreenPreferences({}, "dark")
    path.write_text('theme = "light"\n[keys]\npause = "f5"\n')
    assert read_preferences(path) == ScreenPreferences({"pause": "f5"}, "light")


def test_a_mistake_in_the_file_is_named(path: Path) -> None:
    for text, problem in (
        ('[keys]\npuase = "f5"', "there is no action 'puase'. Did you mean 'pause'?"),
        ('[keys]\npause = "u"', "the key 'u' is used twice. Choose another"),
        ("[keys]\npause = 5", "[keys] must name a key for each action"),
        ('theme = "pink"', "there is no theme 'pink'. Choose one of dark, light, monochrome"),
        ("[keys", "it cannot be read"),
    ):
        path.write_text(text)
        with pytest.raises(FileError, match=r"screen\.toml") as caught:
            read_preferences(path)
        assert problem in str(caught.value)


def test_the_file_is_where_configs_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert preferences_path() == tmp_path / "hexacell" / "screen.toml"


async def test_a_chosen_key_takes_the_place_of_the_other(cell, history, opened) -> None:
    run = ToldRun()
    workplace = workplace_of(cell, run, history[:300])
    async with opened(workplace, preferences=ScreenPreferences({"pause": "f5", "review": "f8"})) as pilot:
        await pilot.press("p")
        await settled(pilot)
        assert run.given == []
        await pilot.press("f5")
        await until(lambda: run.given == [Pause()])
        await pilot.press("f8")
        await until(lambda: pilot.app.current_mode == "review")
        named = {command.title for command in pilot.app.get_system_commands(pilot.app.screen)}
        assert named == {one.description for one in KEYS}  # the palette has everything that a key does
