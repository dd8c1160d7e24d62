"""The keys and the colours of the screens, and the file in which a person may choose others."""

import os
import tomllib
from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from textual.binding import Binding
from textual.theme import Theme

from hexacell.errors import FileError, did_you_mean
from hexacell.storage.atomic_files import decode_utf8, read_if_present

# Primary, secondary, warning, error, success, accent, foreground, background, surface, panel.
_DARK = ("#7aa2f7", "#9ece6a", "#e0af68", "#f7768e", "#9ece6a", "#e0af68", "#d5daf0", "#16181f", "#1d2029")
_LIGHT = ("#1f4fa3", "#2f6b1d", "#8a5300", "#b00020", "#2f6b1d", "#8a5300", "#14161a", "#ffffff", "#f4f5f7")
_GREY = ("#ffffff", "#ffffff", "#ffffff", "#ffffff", "#ffffff", "#ffffff", "#e0e0e0", "#000000", "#000000")

SCREEN_THEMES = (
    Theme("dark", *_DARK, "#272b37"),
    Theme("light", *_LIGHT, "#e3e6eb", dark=False),
    Theme("monochrome", *_GREY, "#303030"),
)


RESUME = "resume"
"""In the place of a mode: go on with the latest run that was interrupted."""

WITH_LENGTH = "optimise with length check"
"""In the place of a mode: a calibration which checks the length scale before its verdict."""


ONCE = "once"
"""The plan is not tried again where it was, or is being tried."""


class ScreenAction(StrEnum):
    """What a person may ask for with one key."""

    PAUSE = "pause"
    PAUSE_AT_ONCE = "pause at once"
    UNDO = "undo"
    MEASURE_AGAIN = "measure again"
    ABORT = "abort"
    TAKE_CONTROL = "take control"
    CHECK = "check"
    START = "start"
    PREVIEW = "preview"
    EXCLUDE = "exclude"
    COMPARE = "compare"
    ROLL_BACK = "roll back"
    APPLY = "apply"
    OPEN = "open"
    DRIFT = "drift"
    STEP = "step"
    PLAY = "play"
    UNFOLD = "unfold"


KEYS = (
    Binding("1", "show('cell')", "Cell", id="cell", show=False),
    Binding("2", "show('preflight')", "Preflight", id="preflight", show=False),
    Binding("3", "show('measure')", "Measure", id="measure", show=False),
    Binding("4", "show('review')", "Review", id="review", show=False),
    Binding("5", "show('history')", "History", id="history", show=False),
    Binding("p", "perform('pause')", "Pause", id="pause"),
    Binding("P", "perform('pause at once')", "Pause at once", id="pause-at-once"),
    Binding("u", "perform('undo')", "Undo", id="undo"),
    Binding("m", "perform('measure again')", "Point again", id="measure-again"),
    Binding("a", "perform('abort')", "End run", id="abort"),
    Binding("w", "answer", "Answer", id="answer"),
    Binding("c", "perform('take control')", "Take control", id="take-control"),
    Binding("d", "digits", "Digits", id="digits"),
    Binding("t", "next_theme", "Light, dark, monochrome", id="theme", show=False),
    Binding("question_mark", "help", "Help", key_display="?", id="help"),
    Binding("q", "leave", "Quit", id="quit"),
)
"""Keys of every screen; ``id`` is the name of the action in the file."""

THEMES = ("dark", "light", "monochrome")


@dataclass(frozen=True, slots=True)
class ScreenPreferences:
    """What a person chose: keys by the names of actions, and a theme."""

    keys: dict[str, str] = field(default_factory=dict)
    theme: str = THEMES[0]


def preferences_path() -> Path:
    """``hexacell/screen.toml`` in the person's folder of configs."""
    folder = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return Path(folder) / "hexacell" / "screen.toml"


def shown_path(path: Path) -> str:
    """A path as a person knows it: below ``~`` where it is in the home folder."""
    home = Path.home()
    return f"~/{path.relative_to(home)}" if path.is_relative_to(home) else str(path)


def read_preferences(path: Path) -> ScreenPreferences:
    """The preferences in the file; the defaults without a file.

    Raises:
        FileError: it cannot be read, names an unknown action or theme, or one key for several actions.
    """
    try:
        content = tomllib.loads(decode_utf8(read_if_present(path) or b"", path))
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"it cannot be read: {error}", subject=path, action="Correct it") from error
    keys, theme = content.get("keys", {}), content.get("theme", THEMES[0])
    _require_keys(keys, path)
    if theme not in THEMES:
        raise FileError(
            f"there is no theme {theme!r}", subject=path, action=f"Choose one of {', '.join(THEMES)}"
        )
    return ScreenPreferences(keys, theme)


def _require_keys(keys: object, path: Path) -> None:
    """Refuse what names no action, or one key for several; raises ``FileError``."""
    known = {str(binding.id): binding.key for binding in KEYS}
    if not isinstance(keys, dict) or not all(isinstance(key, str) for key in keys.values()):
        raise FileError("[keys] must name a key for each action", subject=path, action='Like pause = "f5"')
    for name in keys:
        if name not in known:
            action = did_you_mean(name, known) or f"The actions are {', '.join(known)}"
            raise FileError(f"there is no action {name!r}", subject=path, action=action)
    if twice := [key for key, times in Counter((known | keys).values()).items() if times > 1]:
        raise FileError(f"the key {twice[0]!r} is used twice", subject=path, action="Choose another")
