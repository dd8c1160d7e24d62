"""A question of the run, above the screen; Escape lets it wait."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical, VerticalScroll
from textual.events import Key
from textual.screen import ModalScreen
from textual.widgets import Input

from hexacell.presentation.screens.views import Choice, QuestionView
from hexacell.screen.backend import Backend
from hexacell.screen.widgets.device_panel import DevicePanel
from hexacell.screen.widgets.text_panel import TextPanel

Answering = Callable[[str | None], Awaitable[None]]


class QuestionOverlay(ModalScreen[None]):
    """Takes exactly the answers that the question offers."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "dismiss", "Look at the screens first"),
        ("a", "abort", "Abort"),
        ("pagedown", "scroll_text(1)", "Scroll on"),
        ("pageup", "scroll_text(-1)", "Scroll back"),
    ]
    AUTO_FOCUS = "#question-text"

    def __init__(self, view: QuestionView, number: int, answer: Answering) -> None:
        super().__init__()
        self.number = number
        self._view, self._answer = view, answer

    def compose(self) -> ComposeResult:
        """The question, the gauges where they matter, and what to press."""
        view = self._view
        with Vertical(id="question", classes=f"overlay overlay-{view.urgency}"):
            yield TextPanel(view.title, classes="overlay-title")
            with VerticalScroll(id="question-text"):
                yield TextPanel("\n\n".join(view.paragraphs))
            if view.shows_gauges:
                yield DevicePanel(id="mounting", for_mounting=True)
            if view.refusal:
                yield TextPanel(view.refusal, id="refusal")
            yield TextPanel(view.instruction, id="instruction")
            for choice in view.choices:
                yield TextPanel(_line(choice, view), classes=_classes(choice, view))
            if view.typed and not view.refusal:
                yield Input(placeholder=view.typed, id="typed", compact=True)

    def on_mount(self) -> None:
        """What is typed goes into the field, if there is one."""
        for field in self.query(Input):
            field.cursor_blink = False
            field.focus()

    def action_scroll_text(self, pages: int) -> None:
        """Scroll what is asked, also while a name is typed."""
        text = self.query_one("#question-text", VerticalScroll)
        text.scroll_relative(y=pages * text.size.height, animate=False)

    async def action_abort(self) -> None:
        """Abort the run; not where a name is typed, which may have this letter."""
        if not self._view.typed:
            await self.run_action("app.perform('abort')")

    def draw(self, backend: Backend) -> None:
        """Show the gauges as they are now."""
        if self._view.shows_gauges:
            self.query_one(DevicePanel).show(backend.measure().live)

    async def on_key(self, event: Key) -> None:
        """Take an answer of one key."""
        for choice in self._view.choices:
            if event.key == choice.key and self._may_be_given(choice):
                event.stop()
                await self._answer(choice.value)

    async def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take consent that is typed in full."""
        if event.value.strip().lower() == self._view.typed.lower():
            await self._answer(self._view.consent)

    def _may_be_given(self, choice: Choice) -> bool:
        is_typing = isinstance(self.focused, Input) and len(choice.key) == 1
        return not is_typing and not (choice.is_consent and bool(self._view.refusal))


def _line(choice: Choice, view: QuestionView) -> str:
    blocked = choice.is_consent and view.refusal
    key = choice.key if len(choice.key) == 1 else choice.key.capitalize()
    return f"  {'--' if blocked else key:8} {choice.label}"


def _classes(choice: Choice, view: QuestionView) -> str:
    return "choice refused" if choice.is_consent and view.refusal else "choice"
