"""What is shown above a screen: questions, confirmations, faults, help, and quitting."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Awaitable, Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.events import Key
from textual.screen import ModalScreen, ScreenResultType
from textual.widgets import Input, Static

from hexacell.screen.preferences import KEYS, preferences_path, shown_path
from hexacell.screen.widgets import LinePanel, TextList, TextPanel, coloured
from hexacell.text.screens import help as texts
from hexacell.text.screens import views

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel
    from hexacell.text.screens.placing import Placing

LONGEST_TYPED = 200
"""What is pasted by mistake may be a whole file."""


class PlacingPanel(Horizontal):
    """Ball and gauges as mounted, and beside them where each plunger stands in its travel."""

    def __init__(self) -> None:
        self._picture, self._gauges = Static(id="placing-picture"), LinePanel(id="placing-gauges")
        super().__init__(self._picture, self._gauges, id="placing")
        self._shown: Placing | None = None

    def show(self, placing: Placing) -> None:
        """Show how they stand; the bell rings once all of them are in place."""
        if placing == self._shown:
            return
        if placing.are_in_place and self._shown is not None and not self._shown.are_in_place:
            self.app.bell()
        self._shown = placing
        rows = [Content("").join(coloured(*piece) for piece in row) for row in placing.picture]
        self._picture.update(Content("\n").join(rows))
        lines = [line for pair in placing.gauges for line in (*pair, ("", views.Urgency.CALM))]
        self._gauges.show(lines)


class AnswerOverlay(ModalScreen[ScreenResultType]):
    """Consent is one key, or a text that must be typed in full."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("pagedown", "scroll_text(1)", "Scroll on"),
        ("pageup", "scroll_text(-1)", "Scroll back"),
    ]
    AUTO_FOCUS = "#question-text"

    def __init__(self, view: views.QuestionView) -> None:
        super().__init__()
        self.view = view

    @abstractmethod
    async def _give(self, value: str | None) -> None: ...

    def compose(self) -> ComposeResult:
        """The question, the gauges where they matter, and what to press."""
        view = self.view
        with Vertical(id="question", classes=f"overlay overlay-{view.urgency} beside-{view.beside}"):
            yield TextPanel(view.title, classes="overlay-title")
            first, *more = (*view.paragraphs, view.change)
            with VerticalScroll(id="question-text"):
                yield TextPanel(first)
                yield TextPanel("\n".join(["", "\n\n".join(filter(None, more))]), classes="more")
            if view.beside is views.Beside.PLACING:
                yield PlacingPanel()
            elif view.beside is views.Beside.GAUGES:
                yield LinePanel(id="mounting")
            if view.refusal:
                yield TextPanel(view.refusal, id="refusal")
            yield TextPanel(view.instruction, id="instruction")
            for choice in view.choices:
                is_refused = choice.is_consent and bool(view.refusal)
                key = choice.key if len(choice.key) == 1 else choice.key.capitalize()
                line = f"  {'--' if is_refused else key:8} {choice.label}"
                yield TextPanel(line, classes="choice refused" if is_refused else "choice")
            if view.typed and not view.refusal:
                yield Input(
                    placeholder="type the name here", id="typed", compact=True, max_length=LONGEST_TYPED
                )

    def on_mount(self) -> None:
        """What is typed goes into the field, if there is one."""
        for field in self.query(Input):
            field.cursor_blink = False
            field.focus()

    def action_scroll_text(self, pages: int) -> None:
        """Scroll what is asked, also while a name is typed."""
        text = self.query_one("#question-text", VerticalScroll)
        text.scroll_relative(y=pages * text.size.height, animate=False)

    async def on_key(self, event: Key) -> None:
        """Take an answer of one key."""
        is_typing = isinstance(self.focused, Input) and len(event.key) == 1
        for choice in self.view.choices:
            is_refused = choice.is_consent and bool(self.view.refusal)
            if event.key == choice.key and not is_typing and not is_refused:
                event.stop()
                await self._give(choice.value)

    async def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take consent that is typed in full."""
        if event.value.strip().lower() == self.view.typed.lower():
            await self._give(self.view.consent)


class ConfirmOverlay(AnswerOverlay[str | None]):
    """Gives the answer; None where the person wants nothing of what is asked."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape", "dismiss", "No")]

    async def _give(self, value: str | None) -> None:
        self.dismiss(value)


QUITTING = views.QuestionView(
    title="A run goes on here",
    paragraphs=("What is to become of it?",),
    instruction="Press a key:",
    choices=(
        views.Choice("s", "stop it after its step, and quit; it can be resumed", "stop"),
        views.Choice("l", "quit and leave it running; `hexacell tui` comes back to it", "leave"),
        views.Choice("escape", "stay here", None),
    ),
)


class QuestionOverlay(AnswerOverlay[None]):
    """Stays until the run has the answer."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "dismiss", "Look at the screens first"),
        ("a", "abort", "Abort"),
    ]

    def __init__(
        self, view: views.QuestionView, number: int, answer: Callable[[str | None], Awaitable[None]]
    ) -> None:
        super().__init__(view)
        self.number = number
        self._answer = answer

    async def _give(self, value: str | None) -> None:
        await self._answer(value)

    async def action_abort(self) -> None:
        """Abort the run; not where a name is typed, which may have this letter."""
        if not self.view.typed:
            await self.run_action("app.perform('abort')")

    def draw(self, model: ScreenModel) -> None:
        """Show the gauges as they are now, and the time left, which the question may hide."""
        self.query_one("#question").border_subtitle = model.banner("measure").rest.partition(".")[0]
        if self.view.beside is views.Beside.PLACING:
            self.query_one(PlacingPanel).show(model.devices.placing())
        elif self.view.beside is views.Beside.GAUGES:
            self.query_one("#mounting", LinePanel).show(model.devices.gauges())


class FaultOverlay(ModalScreen[None]):
    """Stays until it was read; of a run, with the ``number`` of its fault, until there is another."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("enter,escape,space", "dismiss", "Read"),
        ("a", "app.perform('abort')", "Abort"),
    ]

    def __init__(self, view: views.FaultView, number: int = 0) -> None:
        super().__init__()
        self._view, self.number = view, number

    def compose(self) -> ComposeResult:
        """Title, cause, next action."""
        with Vertical(id="fault", classes="overlay overlay-alarm"):
            yield TextPanel(self._view.title, classes="overlay-title")
            with VerticalScroll(id="fault-cause"):
                yield TextPanel(self._view.cause)
            if self._view.action:
                yield TextPanel(f"What to do: {self._view.action}", id="fault-action")
            yield TextPanel("Enter closes this.", classes="hint")


class HelpOverlay(ModalScreen[None]):
    """What the screen is for, and the keys."""

    BINDINGS: ClassVar[list[BindingType]] = [("enter,escape,question_mark,q", "dismiss", "Close")]
    AUTO_FOCUS = "#help-text"

    def __init__(self, tab: str, keys: Mapping[str, str]) -> None:
        super().__init__()
        self._tab, self._keys = tab, keys

    def compose(self) -> ComposeResult:
        """The texts."""
        with Vertical(id="help", classes="overlay"):
            yield TextPanel(f"Help: {self._tab}", classes="overlay-title")
            yield TextList(id="help-text")
            yield TextPanel("Escape closes this, the arrows scroll.", classes="hint")

    def on_mount(self) -> None:
        """Show the texts."""
        keys = [f"  {self._keys[str(one.id)]:8} {one.description}" for one in KEYS]
        note = texts.KEYS_NOTE.format(path=shown_path(preferences_path()))
        about = [*texts.SCREEN_HELP[self._tab].splitlines(), ""]
        replay = ["", *texts.REPLAY_HELP.splitlines()]
        self.query_one(TextList).show([*about, f"{texts.KEYS_TITLE}:", *keys, "", note, *replay])
