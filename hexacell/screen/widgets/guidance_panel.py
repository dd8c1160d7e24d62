"""What happens now, what is next, how long it takes, and how to stop."""

from __future__ import annotations

from textual.containers import Vertical

from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.views import Guidance

WORDS = ("Now", "Next", "Time", "Stop")


class GuidancePanel(Vertical):
    """Four lines, the first one emphasised."""

    def __init__(self) -> None:
        self._lines = [TextPanel(classes=f"guidance-{word.lower()}") for word in WORDS]
        super().__init__(*self._lines)

    def show(self, guidance: Guidance) -> None:
        """Show the guidance."""
        texts = (guidance.now, guidance.following, guidance.remaining, guidance.stopping)
        for word, panel, text in zip(WORDS, self._lines, texts, strict=True):
            panel.show(f"{word:5}{text}")
