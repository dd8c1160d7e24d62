"""A technician's whole job at the screen, from mounting the gauges to approving the change."""

import re
from collections.abc import Sequence

import pytest
from textual.pilot import Pilot
from textual.widgets import DataTable, Static

from drivers.interfaces import StartupAction
from hexacell.cell.loader import Cell
from hexacell.cell.recovery import Action, FailureKind
from hexacell.kinematics.pose import Pose
from hexacell.run_process import messages
from hexacell.run_process.client import LOST
from hexacell.screen.app import TechnicianApp
from hexacell.screen.child import Preflight
from hexacell.screen.overlays import ConfirmOverlay, FaultOverlay, QuestionOverlay
from hexacell.screen.widgets import KeyLine, RecordTable
from hexacell.text.screens.measuring import RESUMABLE
from hexacell.text.screens.views import ChecklistItem, Mark
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, Answer, MeasureAgain, Pause, Resume, Undo
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import (
    PLACED,
    PendingChange,
    ask_approval,
    ask_placement,
    ask_recovery,
    ask_startup,
)
from procedures.run.trips import Guard
from procedures.steps import events
from tests.screen.conftest import attended, settled
from tests.screen.told_run import BEGUN, ToldRun, ToldWorkplace, snapshot
from tests.waiting import until

PLACED_AT, IDENTIFIED, PROPOSED = 6, 333, 455
"""Events before the gauges are placed, until the geometry is identified, until the change is proposed."""


def shown(pilot: Pilot[int]) -> str:
    """All text of the screen in front."""
    screen = pilot.app.screen
    texts = [str(panel.content) for panel in screen.query(Static)]
    texts += [f"{one.border_title} {one.border_subtitle}" for one in screen.query(".panel")]
    for table in screen.query(DataTable):
        texts += [" ".join(map(str, table.get_row_at(row))) for row in range(table.row_count)]
    return "\n".join(texts)


async def until_noticed(pilot: Pilot[int], text: str) -> None:
    """Until a notice that goes away by itself says something."""
    await until(lambda: any(text in one.message for one in pilot.app._notifications))


async def press(pilot: Pilot[int], *keys: str) -> None:
    """Press keys one after the other, each once the screen is drawn."""
    for key in keys:
        await pilot.press(key)
        await settled(pilot)


async def until_shown(pilot: Pilot[int], text: str) -> None:
    app = pilot.app
    assert isinstance(app, TechnicianApp)

    def is_shown() -> bool:
        app.draw()
        return text in shown(pilot)

    await until(is_shown)


@pytest.fixture
def run() -> ToldRun:
    return ToldRun()


def workplace_of(cell: Cell, run: ToldRun, history: Sequence[events.Event]) -> ToldWorkplace:
    run.begin(cell)
    run.record(history)
    run.tell(snapshot())
    return ToldWorkplace(cell, run=run)


async def test_from_mounting_to_approval(cell, run, history, opened) -> None:
    proposed = next(event for event in history if isinstance(event, events.Proposed))
    async with opened(workplace_of(cell, run, history[:PLACED_AT])) as pilot:
        run.tell(snapshot(x={"shown_mm": -1.2}))
        run.ask(ask_placement(SetKey(phase=Phase.IDENTIFY, point=1), Pose(0.0, 0.0, 550.0)))
        await until_shown(pilot, "→ x  move it 1.2 mm in, along -x")
        run.tell(snapshot(x={"shown_mm": 0.1}))
        await until_shown(pilot, "✓ x  in place, 0.1 mm from mid travel")
        await press(pilot, "escape", "1")  # a question may wait while one looks at the screens
        assert not isinstance(pilot.app.screen, QuestionOverlay)
        await press(pilot, "w", "enter")
        assert run.given == [Answer(PLACED)]

        run.close_question()
        await until(lambda: not isinstance(pilot.app.screen, QuestionOverlay))
        await press(pilot, "3")
        run.record(history[PLACED_AT:IDENTIFIED])
        await until_shown(pilot, "5/11")
        run.record(history[IDENTIFIED:PROPOSED])
        run.ask(ask_approval(PendingChange(proposed.gates, "-  old\n+  new"), cell=cell.settings.name))
        await until_shown(pilot, "+  new")
        met = len(proposed.gates)
        assert all(gate.passed for gate in proposed.gates)
        assert f"{met} of {met} conditions" in shown(pilot), "nothing speaks against it"
        await press(pilot, "y")
        assert run.given[1:] == [Answer("a person at the screen")]

        run.close_question()
        run.record(history[PROPOSED:])
        run.tell(messages.StatusChanged(status=Status.ENDED))
        await until(lambda: not isinstance(pilot.app.screen, QuestionOverlay))
        await press(pilot, "4")
        await until_shown(pilot, "PASS: The error with its safety margin is within the limit.")
        assert "Teach anew" in shown(pilot)
        assert re.search(r"S1y -\d+\.\d{3} -\d+\.\d{3} -5\.751 0\.095 +changed \(60", shown(pilot))


async def test_any_record_in_the_table_is_measured_again_once_confirmed(cell, run, history, opened):
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        await until_shown(pilot, "point 5")
        await press(pilot, "up", "up", "enter", "n")
        assert run.given == []
        table = pilot.app.screen.query_one(RecordTable)
        assert table.chosen is not None
        point, orientation = map(int, table.chosen.split("/"))
        assert table.cursor_row == table.row_count - 3, "the last one was chosen before"
        await press(pilot, "enter", "y")
        assert run.given == [MeasureAgain(SetKey(phase=Phase.IDENTIFY, point=point), orientation)]


async def test_one_key_each_for_who_is_in_control(cell, run, history, opened) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        await until_shown(pilot, "point 5")
        await press(pilot, "P", "u", "m", "p", "a", "n")
        assert Pause() == run.given[-1], "to end it is confirmed first"
        await press(pilot, "a", "y")
        again = MeasureAgain(SetKey(phase=Phase.IDENTIFY, point=5))
        assert run.given == [Pause(at_once=True), Undo(), again, Pause(), Abort("a person ended it")]
        run.tell(messages.StatusChanged(status=Status.PAUSED))
        await until_shown(pilot, "PAUSED")
        await press(pilot, "p")
        assert run.given.pop() == Resume()
        run.tell(messages.ControlChanged(is_in_control=False, who="grace"))
        await until_shown(pilot, "You only watch; c takes over")
        await press(pilot, "p", "c")
        assert len(run.given) == 5
        assert run.taken == 1


async def test_motion_begins_on_an_explicit_yes_and_a_fault_says_what_to_do(cell, run, history, opened):
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        run.ask(ask_startup(StartupAction.SWITCH_ON, "the machine is off", is_theirs=False))
        await until_shown(pilot, "Is nobody within its reach? Switch the machine on?")
        await press(pilot, "enter", "space", "x")
        assert run.given == []
        await press(pilot, "y")
        run.close_question()
        await until(lambda: not isinstance(pilot.app.screen, QuestionOverlay))
        run.record([tripped_by(Guard.GAUGE_END)])
        await until_shown(pilot, f"Stopped by a guard: {Guard.GAUGE_END.value}")
        assert "What to do: Mend it" in shown(pilot)
        await press(pilot, "enter")
        assert not isinstance(pilot.app.screen, FaultOverlay)
        run.ask(ask_recovery("gauge y answers in inch. Press the in/mm key", (Action.RETRY, Action.ABORT)))
        await until_shown(pilot, "try the same again")
        await press(pilot, "1")
        assert run.given == [Answer("yes"), Answer("retry")]


async def test_of_faults_and_questions_what_waits_is_shown_and_all_of_it(cell, run, history, opened):
    lost = f"gauge y: port /tmp/{'long/' * 20}y was lost. Plug it in and open the device again"
    failed = events.Failed(
        step=None, failure=FailureKind.LINK_LOST, attempt=1, reason=lost, action=Action.ASK
    )
    choices = (Action.RETRY, Action.MEASURE_AGAIN, Action.REDO_SET, Action.ABORT)
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        for guard in (Guard.GAUGE_END, Guard.DRIFT):
            run.record([tripped_by(guard)])
            await until_shown(pilot, f"Stopped by a guard: {guard.value}")
            assert len(pilot.app.screen_stack) == 2
        run.tell(snapshot(y={"problem": lost}))
        run.record([failed])
        run.ask(ask_recovery(lost, choices))
        await until_shown(pilot, "Mend it, then press a number")
        await settled(pilot)
        assert [type(one) for one in pilot.app.screen_stack[1:]] == [QuestionOverlay]
        last = pilot.app.screen.query(".choice").last()
        assert pilot.app.screen.get_widget_at(last.region.x, last.region.y)[0] is last
        chosen = failed.model_copy(update={"action": Action.RETRY, "asked": True})
        run.record([tripped_by(Guard.STALE), chosen])
        run.close_question()
        await until(lambda: len(pilot.app.screen_stack) == 1)
        await settled(pilot)
        assert len(pilot.app.screen_stack) == 1


async def test_what_needs_a_record_is_offered_once_there_is_one(cell, run, opened, history) -> None:
    async with opened(workplace_of(cell, run, history[:PLACED_AT])) as pilot:
        keys = pilot.app.screen.query_one(KeyLine)
        assert "Pause" in str(keys.content)
        assert not any(word in str(keys.content) for word in ("Undo", "Point again", "Record again"))
        run.record(history[PLACED_AT:300])
        await until(lambda: "Undo" in str(pilot.app.screen.query_one(KeyLine).content))


async def test_every_parameter_is_in_the_page_of_the_review(cell, run, history, opened) -> None:
    async with opened(workplace_of(cell, run, history[:PROPOSED])) as pilot:
        await press(pilot, "4")
        table = pilot.app.screen.query_one("#parameters", DataTable)
        await until(lambda: table.row_count > 30 and table.size.height > table.row_count)


def tripped_by(guard: Guard) -> events.Tripped:
    return events.Tripped(guard=guard, device="gauge y", problem="it is so", action="Mend it")


async def test_a_fault_that_the_run_has_left_behind_is_not_shown_on_attaching(cell, run, history) -> None:
    interrupted = events.Interrupted(reason="it drifts", exit_code=1)
    told = [*history[:100], tripped_by(Guard.DRIFT), interrupted, *history[100:300]]
    async with attended(workplace_of(cell, run, told)) as model:
        await until(lambda: "point 5" in model.banner("measure").action)
        assert model.fault() is None


@pytest.mark.parametrize(
    ("ending", "fault", "now"),
    [
        (
            (
                messages.EventRecorded(
                    sequence=999, at=BEGUN, event=events.Interrupted(reason="aborted", exit_code=130)
                ),
                messages.StatusChanged(status=Status.ENDED),
                messages.HostFailed(problem="aborted", exit_code=130),
            ),
            ("The run ended early", "aborted", RESUMABLE),
            "aborted",
        ),
        ((LOST,), ("The run could not go on", LOST.problem, LOST.action), LOST.problem),
    ],
    ids=["it was aborted", "its process died"],
)
async def test_the_end_of_a_run_is_a_single_fault_and_it_is_not_shown_as_running(
    ending: tuple[messages.HostMessage, ...],
    fault: tuple[str, str, str],
    now: str,
    cell: Cell,
    run: ToldRun,
    history: tuple[events.Event, ...],
) -> None:
    async with attended(workplace_of(cell, run, history[:300])) as model:
        run.tell(*ending)
        run.end()
        await until(lambda: model.banner("measure").word == "ENDED EARLY")
        shown_fault = model.fault()
        assert shown_fault is not None
        assert (shown_fault.title, shown_fault.cause, shown_fault.action) == fault
        assert model.fault_number == 1001
        shown_banner = model.banner("measure")
        assert shown_banner.following.lower() == now.lower()
        assert shown_banner.action.startswith("Press 2, then r resumes it")


async def test_a_change_that_is_declined_is_no_fault_and_no_early_end(cell, run, history) -> None:
    declined = events.Interrupted(reason="the new geometry was declined", exit_code=1)
    async with attended(workplace_of(cell, run, [*history[:PROPOSED], declined])) as model:
        run.tell(messages.StatusChanged(status=Status.ENDED), messages.HostFailed(problem="x", exit_code=1))
        run.end()
        await until(lambda: model.banner("measure").word == "NOT WRITTEN")
        assert model.fault() is None


@pytest.mark.parametrize(
    ("key", "keeps_running"), [("l", True), pytest.param("s", False, marks=pytest.mark.slow)]
)
async def test_each_way_to_quit_asks_about_the_run(key, keeps_running, cell, run, history, opened) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        await until_shown(pilot, "point 5")
        for way in ("q", "ctrl+q"):
            await press(pilot, way, way)
            await until(lambda: isinstance(pilot.app.screen, ConfirmOverlay))
            assert [type(one) for one in pilot.app.screen_stack].count(ConfirmOverlay) == 1
            await press(pilot, "escape")
        await press(pilot, "ctrl+c")
        [notice] = pilot.app._notifications
        assert notice.message.startswith("q leaves; what becomes of a run")
        assert run.left == []
        await press(pilot, "q", key)
        await until(lambda: run.left == [keeps_running])


async def test_a_run_begins_once_everything_holds_that_must_hold(cell, run, opened) -> None:
    run.begin(cell)
    found = ChecklistItem(Mark.FAILED, "gauge y", "it answers in inch", "Press the in/mm key")
    workplace = ToldWorkplace(cell, live=[snapshot()], started=run)
    holds, workplace.preflight = workplace.preflight, Preflight(items=(found,), is_ready=False)
    async with opened(workplace) as pilot:
        await press(pilot, "p", "u", "m", "a")  # these do nothing without a run
        assert not isinstance(pilot.app.screen, FaultOverlay)
        await press(pilot, "2")
        started: list[str] = []
        for key in ("s", "k", "K", "l", "L"):
            workplace.checked.clear()
            await press(pilot, key)
            await until(lambda: len(workplace.checked) == 1)
            started.append(*workplace.checked)
            await until_shown(pilot, "NOT READY")
        assert started == ["optimise", "check", "quick", "length", "optimise with length check"]
        assert "✗ gauge y: it answers in inch" in shown(pilot)
        assert "→ Press the in/mm key" in shown(pilot)
        assert workplace.begun == []
        workplace.preflight = holds
        await press(pilot, "s")
        await until_shown(pilot, "calibration")
        assert workplace.begun == ["optimise"]
        assert pilot.app.current_mode == "measure"
