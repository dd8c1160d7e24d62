"""The colours: dark, light, and shades of grey alone. None of them carries a meaning of its own."""

from __future__ import annotations

from textual.theme import Theme

SCREEN_THEMES = (
    Theme(
        name="dark",
        primary="#7aa2f7",
        secondary="#9ece6a",
        accent="#e0af68",
        warning="#e0af68",
        error="#f7768e",
        success="#9ece6a",
        foreground="#d5daf0",
        background="#16181f",
        surface="#1d2029",
        panel="#272b37",
        dark=True,
    ),
    Theme(
        name="light",
        primary="#1f4fa3",
        secondary="#2f6b1d",
        accent="#8a5300",
        warning="#8a5300",
        error="#b00020",
        success="#2f6b1d",
        foreground="#14161a",
        background="#ffffff",
        surface="#f4f5f7",
        panel="#e3e6eb",
        dark=False,
    ),
    Theme(
        name="monochrome",
        primary="#ffffff",
        secondary="#ffffff",
        accent="#ffffff",
        warning="#ffffff",
        error="#ffffff",
        success="#ffffff",
        foreground="#e0e0e0",
        background="#000000",
        surface="#000000",
        panel="#303030",
        dark=True,
    ),
)
