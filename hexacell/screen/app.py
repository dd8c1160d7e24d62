"""The application: five screens over one model, keys, palette, themes, overlays, and quitting."""

from __future__ import annotations

import asyncio
import gc
import re
import time
from collections.abc import Callable, Coroutine, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from textual.app import App, SystemCommand
from textual.binding import BindingType
from textual.css.query import NoMatches
from textual.screen import Screen

from hexacell.errors import HexacellError, UsageError
from hexacell.plugins import plugin_failures_named
from hexacell.printable import printable
from hexacell.screen import overlays, tabs
from hexacell.screen.further_screens import AssistantScreen, CellFileScreen, DigitsScreen, PlanScreen
from hexacell.screen.preferences import KEYS, ONCE, SCREEN_THEMES, THEMES, ScreenAction, ScreenPreferences
from hexacell.screen.widgets import CardGrid, KeyLine
from hexacell.text.screens.views import FaultView

if TYPE_CHECKING:
    from hexacell.screen.first_values import FirstValues
    from hexacell.screen.model import ScreenModel
    from hexacell.text.screens.first_questions import FirstCellAssistant

DRAWN_AFTER_S = 0.05
"""What changes within so long is drawn together, s."""

AGES_EVERY_S = 1.0
"""How often everything is drawn though nothing has changed: ages of readings grow, s."""

CALL = re.compile(r"(?:app\.)?perform\('([^']*)'(?:, '([^']*)')?\)")
"""An action of the model, with what it is about."""

MADE_EVERY_S = 0.04
"""Pause after each screen that is made behind the first one, s: for what else is to be done meanwhile."""

MADE_AFTER_S = 0.2
"""How long nobody has asked for a screen before one is made behind the first one, s."""

KNOWN_AFTER_S = 1.0
"""Longest wait for the first values of the devices before the rest is loaded, s."""

SHOWN_AFTER_S = 0.01
"""Another screen is drawn so much later than asked for, s, which is made before."""

LEAVING_TAKES_S = 6.0
"""Longest wait for the host's answer when a person leaves, s."""

SCREENS: tuple[type[tabs.TabScreen], ...] = (
    tabs.CellScreen,
    tabs.PreflightScreen,
    tabs.MeasureScreen,
    tabs.ReviewScreen,
    tabs.HistoryScreen,
)


def _assistant(path: Path) -> FirstCellAssistant:
    from hexacell.text.screens.first_questions import FirstCellAssistant  # noqa: PLC0415 - loaded late

    return FirstCellAssistant(path)


class TechnicianApp(App[int]):
    """Loads its model behind the first screen and draws what that knows whenever it changes.

    Attributes:
        model: what is shown; None while it loads.
    """

    TITLE = "hexacell"
    CSS_PATH = "styles.tcss"
    BINDINGS: ClassVar[list[BindingType]] = list(KEYS)
    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (110, "-wide")]  # noqa: RUF012 - as Textual declares it
    VERTICAL_BREAKPOINTS = [(0, "-low"), (32, "-tall")]  # noqa: RUF012 - as Textual declares it
    DEFAULT_MODE = "cell"

    def __init__(
        self,
        load: Callable[[], ScreenModel],
        preferences: ScreenPreferences | None = None,
        *,
        first_cell: Path | None = None,
        first_values: FirstValues | None = None,
    ) -> None:
        self.preferences = preferences or ScreenPreferences()
        self.keys_in_use = {str(one.id): one.key_display or one.key for one in KEYS} | self.preferences.keys
        self._load, self._first_cell, self._first_values = load, first_cell, first_values
        self.model: ScreenModel | None = None
        self._is_loaded = asyncio.Event()
        self._shown_at = 0.0
        self._question_seen, self._fault_seen, self._runs_seen, self._refusals_seen = 0, 0, 0, 0
        super().__init__()
        for theme in SCREEN_THEMES:
            self.register_theme(theme)
        for screen in SCREENS:
            self.add_mode(screen.TAB, partial(screen, self.keys_in_use))
        self.theme = self.preferences.theme
        self.stylesheet.set_variables(self.get_css_variables())  # before it is read for the first time
        self.set_keymap(self.preferences.keys)

    def delay_update(self, delay: float = SHOWN_AFTER_S) -> None:
        """Draw nothing while a screen takes another one's place: Textual waits until one could be made."""
        super().delay_update(delay)

    def refresh_css(self, animate: bool = True) -> None:
        """Style the screens anew where the one in front was styled for another theme.

        Textual asks for it at the first visit of each screen too, and then reads all styles again.
        """
        front = self.screen_stack[-1] if self.screen_stack else None
        if isinstance(front, tabs.TabScreen) and front.theme_of_styles == self.theme:
            return
        super().refresh_css(animate=animate)
        for screen in self.screen_stack:
            if isinstance(screen, tabs.TabScreen):
                screen.theme_of_styles = self.theme

    def on_mount(self) -> None:
        """Load what is behind the screens once the first one is drawn."""
        self.call_after_refresh(
            lambda: self.run_worker(self._attend(), exit_on_error=False, group="attend")
        )

    async def _attend(self) -> None:
        try:
            if not await self._has_cell():
                self.exit(0)
                return
            with plugin_failures_named():
                if self._first_values is not None:
                    await self._show_first(self._first_values)
                self.model = await asyncio.to_thread(self._load)
            self._is_loaded.set()
            gc.freeze()  # what is loaded stays: to look through it for garbage would keep keys waiting
            self.draw()
            self.set_interval(AGES_EVERY_S, self.draw)
            self.run_worker(self._draw_changes(self.model), exit_on_error=False, group="draw")
            self.run_worker(self._make_screens(self.model), exit_on_error=False, group="make")
            await self.model.attend()
        except HexacellError as error:
            self._show_error(error)

    async def _show_first(self, values: FirstValues) -> None:
        """Show what the devices show, before anything else that takes time; not what they do not show."""
        known = asyncio.Event()

        def drawn() -> None:
            self.draw()
            if values.are_known:
                known.set()

        await asyncio.to_thread(values.load, drawn)
        values.start()
        with suppress(TimeoutError):
            async with asyncio.timeout(KNOWN_AFTER_S):
                await known.wait()

    async def _draw_changes(self, model: ScreenModel) -> None:
        """Draw what has changed, all of it together that does so at about the same time."""
        while True:
            await model.changed.wait()
            await asyncio.sleep(DRAWN_AFTER_S)
            model.changed.clear()
            self.draw()

    async def _make_screens(self, model: ScreenModel) -> None:
        """Make the screens behind the first one before somebody wants them, then draw the robot."""
        for screen in SCREENS[1:]:
            await self._nobody_asks()
            if self.is_running:  # what is being closed must not grow
                # To Textual it is as if one had gone there and come back, without a frame in between.
                await self._init_mode(screen.TAB)
                await asyncio.sleep(MADE_EVERY_S)
        await model.draw_robot()

    async def _nobody_asks(self) -> None:
        """Wait until nobody has asked for a screen for a while."""
        rest = self._shown_at + MADE_AFTER_S - time.monotonic()
        if rest > 0.0:
            await asyncio.sleep(rest)
            await self._nobody_asks()

    async def _has_cell(self) -> bool:
        """Whether there is a cell file, once the first-time assistant was used if it is needed."""
        if self._first_cell is None:
            return True
        assistant = await asyncio.to_thread(_assistant, self._first_cell)
        is_made: bool = await self.push_screen_wait(AssistantScreen(assistant, self._first_cell))
        return is_made

    def draw(self) -> None:
        """Show what is so now in the screen in front, and in what lies below it."""
        if not self.screen_stack:  # it is being closed
            return
        if self.model is None:  # it is loading
            if self._first_values is not None and isinstance(self.screen, tabs.CellScreen):
                self.screen.query_one(CardGrid).show(self._first_values.cards())
            return
        for screen in self.screen_stack:
            with suppress(NoMatches):  # it is being composed, or taken away
                if isinstance(screen, tabs.TabScreen):
                    screen.draw(self.model, self.has_effect)
                elif isinstance(screen, DigitsScreen | PlanScreen | overlays.QuestionOverlay):
                    screen.draw(self.model)
        refusals, refused = self.model.refusal
        if refusals > self._refusals_seen:
            self.notify(printable(refused), severity="warning", markup=False)
        self._refusals_seen = refusals
        if self.model.run.runs != self._runs_seen:  # a new run is shown; overlays come after that
            self._runs_seen = self.model.run.runs
            self.action_show("measure")
            with suppress(KeyError, NoMatches):  # it is not made yet
                self.get_screen_stack("review")[0].query_one("#details").scroll_home(animate=False)
        elif self._is_whole:
            self._overlay_news(self.model)

    @property
    def _is_whole(self) -> bool:
        """Whether the screen in front is made to its last line; nothing is laid above it before."""
        if not isinstance(self.screen, tabs.TabScreen):
            return True
        return any(line.outer_size.width == self.size.width for line in self.screen.query(KeyLine))

    def _overlay_news(self, model: ScreenModel) -> None:
        """A question or fault; an older fault of the run, which nobody has closed, is not to lie below."""
        view, number, front = model.fault(), model.fault_number, self.screen
        kept = {0} if model.question() else {0, number}
        if isinstance(front, overlays.FaultOverlay) and front.number not in kept:
            front.dismiss()
        self._overlay_question(model)
        if view is not None and number != self._fault_seen:
            self.push_screen(overlays.FaultOverlay(view, number))
        self._fault_seen = number

    def _overlay_question(self, model: ScreenModel) -> None:
        number, view = model.run.questions, model.question()
        shown = next((one for one in self.screen_stack if isinstance(one, overlays.QuestionOverlay)), None)
        if shown is not None and (view is None or shown.number != number) and shown.is_current:
            shown.dismiss()
        if view is not None and number != self._question_seen:
            self._question_seen = number
            self.push_screen(overlays.QuestionOverlay(view, number, self._answer))

    async def _answer(self, value: str | None) -> None:
        if self.model is not None:
            self._start(self.model.answer(value))

    def _start(self, work: Coroutine[Any, Any, str | None]) -> None:
        """Do something without waiting for it, so that the next key is heard at once."""
        self.run_worker(self._waiting_for(work), exit_on_error=False)

    async def _waiting_for(self, work: Coroutine[Any, Any, str | None]) -> None:
        try:
            with plugin_failures_named():
                said = await work
            if said:
                self.notify(printable(said), markup=False)
        except UsageError as error:
            self.notify(printable(str(error)), severity="warning", markup=False)
        except HexacellError as error:
            self._show_error(error)
        finally:
            self.draw()

    def _show_error(self, error: HexacellError) -> None:
        self.push_screen(
            overlays.FaultOverlay(FaultView("That did not work", error.cause, error.action or ""))
        )

    def has_effect(self, action: str) -> bool:
        """Whether a key that does this has an effect now."""
        if self.model is None:
            return CALL.match(action) is None
        if asked := CALL.match(action):
            return self.model.allows(ScreenAction(asked[1]), asked[2] or "")
        if action == "record_again":
            return self.model.allows(ScreenAction.MEASURE_AGAIN)
        if action == "answer":
            return self.model.question() is not None or bool(self.model.proposing_run)
        return True

    def action_show(self, tab: str) -> None:
        """Go to another screen."""
        self._shown_at = time.monotonic()
        self.switch_mode(tab)
        self.draw()

    def action_perform(self, action: str, argument: str = "") -> None:
        """Ask for something."""
        self._start(self._confirmed(ScreenAction(action), argument))

    async def _confirmed(self, action: ScreenAction, argument: str) -> str:
        """Do something once all is loaded, and a person has confirmed it where that is needed."""
        await self._is_loaded.wait()
        assert self.model is not None  # noqa: S101 - it is loaded
        model = self.model
        may = model.allows(action, argument)
        question = await model.confirmation(action, argument) if may else None
        if question is not None:
            consent = await self.push_screen_wait(overlays.ConfirmOverlay(question))
            if consent is None:
                return ""
        return await model.perform(action, argument)

    def action_answer(self) -> None:
        """Show the open question again, or ask whether to write what the run in front has proposed."""
        self._question_seen = 0
        model = self.model
        if model is not None and model.question() is None and model.proposing_run:
            self.action_perform("apply", model.proposing_run)

    def action_digits(self) -> None:
        """Show the gauges in large figures."""
        self.push_screen(DigitsScreen())

    def action_cell_file(self) -> None:
        """Show the whole cell file."""
        if self.model is not None:
            self.push_screen(CellFileScreen(*self.model.described))

    def action_plan(self) -> None:
        """Show the poses of the plan; it is tried first where it was not yet."""
        if self.model is not None:
            self.push_screen(PlanScreen())
            self.action_perform("preview", ONCE)

    def action_help(self) -> None:
        """Explain the screen in front."""
        self.push_screen(overlays.HelpOverlay(self.current_mode, self.keys_in_use))

    def action_next_theme(self) -> None:
        """Dark, light, monochrome, in turn."""
        self.theme = THEMES[(THEMES.index(self.theme) + 1) % len(THEMES)]

    def action_leave(self) -> None:
        """Quit; while a run goes on, ask what becomes of it."""
        if self.model is not None and self.model.may_leave_run:
            self.push_screen(overlays.ConfirmOverlay(overlays.QUITTING), self._leave)
        else:
            self._leave("leave")

    async def action_quit(self) -> None:
        """Quit by Textual's own key, ctrl+q, too."""
        if getattr(self.screen, "view", None) is not overlays.QUITTING:
            self.action_leave()

    def action_help_quit(self) -> None:
        """Say how to leave where somebody presses ctrl+c."""
        self.notify(
            f"{self.keys_in_use['quit']} leaves; what becomes of a run that goes on is asked first."
        )

    def _leave(self, leaving: str | None) -> None:
        if leaving in {"stop", "leave"}:
            self.run_worker(self._quit(keep_running=leaving == "leave"), exit_on_error=False)

    async def _quit(self, *, keep_running: bool) -> None:
        if self.model is not None:
            with suppress(HexacellError, TimeoutError):
                async with asyncio.timeout(LEAVING_TAKES_S):
                    await self.model.leave(keep_running=keep_running)
        self.exit(0)

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:  # noqa: ARG002 - the same everywhere
        """Everything that a key does, by its name."""
        for one in KEYS:
            key = self.keys_in_use[str(one.id)]
            yield SystemCommand(one.description, f"key {key}", partial(self.run_action, one.action))
