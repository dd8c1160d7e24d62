"""A question of the run, above the screen; Escape lets it wait."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import ClassVar

from textual.binding import BindingType

from hexacell.screen.backend import Backend
from hexacell.screen.overlays.answer_overlay import AnswerOverlay
from hexacell.screen.widgets.device_panel import DevicePanel
from hexacell.text.screens.views import QuestionView

Answering = Callable[[str | None], Awaitable[None]]


class QuestionOverlay(AnswerOverlay[None]):
    """Stays until the run has the answer."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "dismiss", "Look at the screens first"),
        ("a", "abort", "Abort"),
    ]

    def __init__(self, view: QuestionView, number: int, answer: Answering) -> None:
        super().__init__(view)
        self.number = number
        self._answer = answer

    async def give(self, value: str | None) -> None:
        """See :class:`AnswerOverlay`."""
        await self._answer(value)

    async def action_abort(self) -> None:
        """Abort the run; not where a name is typed, which may have this letter."""
        if not self.view.typed:
            await self.run_action("app.perform('abort')")

    def draw(self, backend: Backend) -> None:
        """Show the gauges as they are now."""
        if self.view.shows_gauges:
            self.query_one(DevicePanel).show(backend.measure().live)
