"""Who presses every key, pastes whole files and resizes the terminal breaks nothing."""

import string

import pytest
from textual.events import Paste
from textual.pilot import Pilot
from textual.widgets import Input

from hexacell.screen.overlays import ConfirmOverlay, QuestionOverlay
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
    grave = AcceptanceGate(
        name="within tolerance", passed=False, sentence="Far.", needs_person=True, needs_cell_name=True
    )
    run = ToldRun()
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        run.ask(ask_approval(PendingChange((grave,), "-old\n+new"), cell=cell.settings.name))
        await until(lambda: isinstance(pilot.app.screen, QuestionOverlay))
        await settled(pilot)
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


async def test_each_way_to_quit_asks_about_the_run(cell, history, opened) -> None:
    run = ToldRun()
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        await until_shown(pilot, "point 5")
        for key in ("q", "ctrl+q"):
            await press(pilot, key, key)
            await until(lambda: isinstance(pilot.app.screen, ConfirmOverlay))
            assert [type(one) for one in pilot.app.screen_stack].count(ConfirmOverlay) == 1
            await press(pilot, "escape")
        await press(pilot, "ctrl+c")
        [notice] = pilot.app._notifications
        assert notice.message.startswith("q leaves; what becomes of a run")
        assert run.left == []
