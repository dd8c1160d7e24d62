"""Who presses every key, pastes whole files and resizes the terminal breaks nothing."""

import string

import pytest
from textual.events import Paste
from textual.pilot import Pilot
from textual.widgets import Input

from hexacell.screen.overlays import QuestionOverlay
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.run.questions import PendingChange, ask_approval
from tests.screen.conftest import settled
from tests.screen.test_job import press, until_shown, workplace_of
from tests.screen.test_plan_screen import tried
from tests.screen.test_snapshots import idle
from tests.screen.told_run import ToldRun
from tests.waiting import until

NAMED = ("enter", "escape", "tab", "shift+tab", "up", "down", "left", "right", "home", "end", "pageup")
MORE = ("pagedown", "backspace", "delete", "insert", "space", "f1", "f5", "question_mark", "plus")
CONTROL = ("ctrl+a", "ctrl+c", "ctrl+z", "ctrl+d")
KEYS = (*(set(string.ascii_letters + string.digits) - {"q"}), *NAMED, *MORE, *CONTROL)
SIZES = ((40, 10), (300, 100), (80, 24))


async def press_everything(pilot: Pilot[int], tab: str) -> None:
    """Every key twice on one screen, going back to it from wherever that leads."""
    for number, key in enumerate(sorted(KEYS)):
        if number % 10 == 0:
            await pilot.resize_terminal(*SIZES[number // 10 % len(SIZES)])
        await pilot.press(key, key)
        for _ in range(len(pilot.app.screen_stack)):
            await pilot.press("escape")
        await pilot.press(tab)


@pytest.mark.slow
@pytest.mark.parametrize("tab", list("12345"))
@pytest.mark.parametrize("is_running", [False, True], ids=["idle", "running"])
async def test_every_key_on_every_screen_twice(tab, is_running, cell, history, opened) -> None:
    run = ToldRun()
    workplace = workplace_of(cell, run, history[:300]) if is_running else idle(cell)
    workplace.plan, workplace.opened = tried(cell), ToldRun()
    async with opened(workplace) as pilot:
        await press_everything(pilot, tab)
        await settled(pilot)
        assert pilot.app.is_running
        assert "Preflight" in "".join(str(one.render()) for one in pilot.app.screen.query("TabLine"))


async def test_what_is_pasted_into_a_name_is_no_consent(cell, history, opened) -> None:
    """Nor has a long change what to press out of sight, whether or not the name is asked for."""
    run = ToldRun()
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        for is_grave in (False, True):
            gate = AcceptanceGate(
                name="far",
                passed=not is_grave,
                sentence="Far. " * 40,
                needs_person=True,
                needs_cell_name=True,
            )
            change = PendingChange((gate,), "-  old\n+  new\n" * 100)
            run.ask(ask_approval(change, cell=cell.settings.name))
            await until_shown(pilot, "+  new")
            await settled(pilot)
            last = pilot.app.screen.query("Input" if is_grave else ".choice").last()
            assert 0 < last.region.height <= last.region.bottom <= 24
            assert pilot.app.screen.get_widget_at(last.region.x, last.region.bottom - 1)[0] is last
            if not is_grave:
                run.close_question()
                await until(lambda: not isinstance(pilot.app.screen, QuestionOverlay))
        field = pilot.app.screen.query_one(Input)
        field.post_message(Paste("y\n" * 2500))
        for size in SIZES:
            await pilot.resize_terminal(*size)
        await press(pilot, "enter")
        assert run.given == []
        field.value = ""
        field.post_message(Paste(f"{cell.settings.name}\n"))
        await press(pilot, "enter")
        await until(lambda: len(run.given) == 1)
