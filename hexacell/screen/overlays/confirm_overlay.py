"""A question of the screen itself, before it changes something."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import BindingType

from hexacell.screen.overlays.answer_overlay import AnswerOverlay


class ConfirmOverlay(AnswerOverlay[bool]):
    """Gives whether the person consented."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape", "dismiss(False)", "No")]

    async def give(self, value: str | None) -> None:
        """See :class:`AnswerOverlay`."""
        self.dismiss(value is not None)
