"""A technician's whole job at the screen, from mounting the gauges to approving the change."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from textual.pilot import Pilot

from drivers.interfaces import StartupAction
from hexacell.cell.loader import Cell
from hexacell.cell.recovery import Action, FailureKind
from hexacell.kinematics.pose import Pose
from hexacell.run_process.messages import ControlChanged, HostFailed, StatusChanged
from hexacell.screen.app import TechnicianApp
from hexacell.screen.overlays import FaultOverlay, QuestionOverlay
from hexacell.screen.widgets import TextList, TextPanel
from hexacell.screen.workplace import Preflight
from hexacell.text.screens.views import ChecklistItem, Mark
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, Answer, Command, MeasureAgain, Pause, Resume, Undo
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import PLACED, ask_approval, ask_placement, ask_recovery, ask_startup
from procedures.run.trips import Guard
from procedures.steps import events
from tests.screen.conftest import Opened, settled
from tests.screen.told_run import ToldRun, ToldWorkplace, past_run, snapshot
from tests.waiting import until

PLACED_AT, IDENTIFIED, PROPOSED = 6, 333, 455
"""Events before the gauges are placed, until the geometry is identified, until the change is proposed."""


def shown(pilot: Pilot[int]) -> str:
    """All text of the screen in front."""
    return "\n".join(panel.text for panel in pilot.app.screen.query(TextPanel))


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


async def test_from_mounting_to_approval(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    proposed = next(event for event in history if isinstance(event, events.Proposed))
    async with opened(workplace_of(cell, run, history[:PLACED_AT])) as pilot:
        run.tell(snapshot(x={"shown_mm": -1.2}))
        run.ask(ask_placement(SetKey(phase=Phase.IDENTIFY, point=1), Pose(0.0, 0.0, 550.0)))
        await until_shown(pilot, "move the x gauge 1.2 mm in (along -x)")
        run.tell(snapshot(x={"shown_mm": 0.1}))
        await until_shown(pilot, "ok, 0.1 mm from mid travel")
        await press(pilot, "enter")
        assert run.given == [Answer(PLACED)]

        run.close_question()
        run.record(history[PLACED_AT:IDENTIFIED])
        await until_shown(pilot, "5/11")
        run.record(history[IDENTIFIED:PROPOSED])
        run.ask(ask_approval(proposed.gates, "-  old\n+  new", cell=cell.settings.name))
        await until_shown(pilot, "+  new")
        assert "ok  The data determine every parameter." in shown(pilot)
        await press(pilot, "y")
        assert run.given[1:] == [Answer("a person at the screen")]

        run.close_question()
        run.record(history[PROPOSED:])
        run.tell(StatusChanged(status=Status.ENDED))
        await until(lambda: not isinstance(pilot.app.screen, QuestionOverlay))
        await press(pilot, "4")
        await until_shown(pilot, "PASS: The error and the guard band together are within the limit.")
        assert "S1y       -155.000    -160.751    -5.751    0.095  changed (60." in shown(pilot)


@pytest.mark.parametrize(
    ("key", "command"),
    [
        ("p", Pause()),
        ("P", Pause(at_once=True)),
        ("u", Undo()),
        ("m", MeasureAgain(SetKey(phase=Phase.IDENTIFY, point=5))),
        ("a", Abort()),
    ],
)
async def test_one_key_each(
    key: str,
    command: Command,
    cell: Cell,
    run: ToldRun,
    history: tuple[events.Event, ...],
    opened: Opened,
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        await until_shown(pilot, "point 5")
        await press(pilot, key)
        assert run.given == [command]


async def test_the_same_key_goes_on_after_a_pause(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        run.tell(StatusChanged(status=Status.PAUSED))
        await until_shown(pilot, "paused: the robot stands still")
        await press(pilot, "p")
        assert run.given == [Resume()]


async def test_keys_of_a_run_do_nothing_without_one(cell: Cell, opened: Opened) -> None:
    async with opened(ToldWorkplace(cell, live=[snapshot()])) as pilot:
        await press(pilot, "p", "u", "m", "a")
        assert not isinstance(pilot.app.screen, FaultOverlay)


async def test_who_only_watches_gives_no_commands_until_taking_over(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        run.tell(ControlChanged(is_in_control=False, who="grace"))
        await until_shown(pilot, "you only watch: grace is in control; c takes over")
        await press(pilot, "p")
        assert run.given == []
        await press(pilot, "c")
        assert run.taken == 1


async def test_a_gate_that_failed_greys_the_approval_and_says_why(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    failed = AcceptanceGate(name="converged", passed=False, sentence="The solver ended too early.")
    async with opened(workplace_of(cell, run, history[:PROPOSED])) as pilot:
        run.ask(ask_approval([failed], "-  old\n+  new", cell=cell.settings.name))
        await until_shown(pilot, "It cannot be approved. The solver ended too early.")
        await press(pilot, "y")
        assert run.given == []
        await press(pilot, "n")
        assert run.given == [Answer(None)]


async def test_a_grave_change_needs_the_name_of_the_cell(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    far = AcceptanceGate(name="far", passed=False, sentence="Far.", needs_person=True, needs_cell_name=True)
    async with opened(workplace_of(cell, run, history[:PROPOSED])) as pilot:
        run.ask(ask_approval([far], "-  old\n+  new", cell=cell.settings.name))
        await until_shown(pilot, f"Type the cell's name, {cell.settings.name}")
        await pilot.press("y", "e", "s", "enter")
        await settled(pilot)
        assert run.given == []
        await pilot.press("backspace", "backspace", "backspace")
        await press(
            pilot, *("minus" if letter == "-" else letter for letter in cell.settings.name), "enter"
        )
        assert run.given == [Answer("a person at the screen")]


@pytest.mark.sample("*-size0")
@pytest.mark.parametrize("size", [(80, 24), (100, 32), (140, 40)])
@pytest.mark.parametrize("is_grave", [False, True])
async def test_a_long_change_leaves_in_sight_what_to_press(
    size: tuple[int, int],
    is_grave: bool,
    cell: Cell,
    run: ToldRun,
    history: tuple[events.Event, ...],
    opened: Opened,
) -> None:
    gate = AcceptanceGate(
        name="far", passed=not is_grave, sentence="Far. " * 40, needs_person=True, needs_cell_name=True
    )
    async with opened(workplace_of(cell, run, history[:PROPOSED]), size) as pilot:
        run.ask(ask_approval([gate], "-  old\n+  new\n" * 100, cell=cell.settings.name))
        await until_shown(pilot, "+  new")
        await settled(pilot)
        last = pilot.app.screen.query("Input" if is_grave else ".choice").last()
        assert last.region.height > 0
        assert last.region.bottom <= size[1]
        assert pilot.app.screen.get_widget_at(last.region.x, last.region.bottom - 1)[0] is last


async def test_a_question_may_wait_while_one_looks_at_the_screens(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:PLACED_AT])) as pilot:
        run.ask(ask_placement(SetKey(phase=Phase.IDENTIFY, point=1), Pose(0.0, 0.0, 550.0)))
        await until_shown(pilot, "Put the gauges around the ball")
        await press(pilot, "escape", "1")
        assert not isinstance(pilot.app.screen, QuestionOverlay)
        await press(pilot, "w")
        assert isinstance(pilot.app.screen, QuestionOverlay)
        run.close_question()
        await until(lambda: not isinstance(pilot.app.screen, QuestionOverlay))


async def test_the_robot_moves_only_after_an_explicit_yes(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:2])) as pilot:
        run.ask(ask_startup(StartupAction.SWITCH_ON, "the machine is off", is_theirs=False))
        await until_shown(pilot, "Is nobody within its reach? Switch the machine on?")
        await press(pilot, "enter", "space", "x")
        assert run.given == []
        await press(pilot, "y")
        assert run.given == [Answer("yes")]


async def test_a_failure_offers_its_recoveries_by_number(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        run.ask(ask_recovery("gauge y answers in inch. Press the in/mm key", (Action.RETRY, Action.ABORT)))
        await until_shown(pilot, "retry: try the same again")
        await press(pilot, "1")
        assert run.given == [Answer("retry")]


async def test_every_guard_says_what_to_do(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        for guard in Guard:
            tripped = events.Tripped(guard=guard, device="gauge y", problem="it is so", action="Mend it")
            run.record([tripped])
            await until_shown(pilot, f"Stopped by a guard: {guard.value}")
            assert "What to do: Mend it" in shown(pilot)
            await press(pilot, "enter")
            assert not isinstance(pilot.app.screen, FaultOverlay)


async def test_a_fault_that_the_run_has_left_behind_is_not_shown_on_attaching(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    tripped = events.Tripped(guard=Guard.DRIFT, device="gauge y", problem="it drifts", action="Mend it")
    told = [*history[:100], tripped, events.Interrupted(reason="it drifts", exit_code=1), *history[100:300]]
    async with opened(workplace_of(cell, run, told)) as pilot:
        await until_shown(pilot, "point 5")
        assert not isinstance(pilot.app.screen, FaultOverlay)


async def test_every_kind_of_failure_says_what_the_run_does(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        for kind in FailureKind:
            reason = f"gauge y: {kind.value}. Mend it"
            run.record(
                [events.Failed(step=None, failure=kind, attempt=2, reason=reason, action=Action.REDO_SET)]
            )
            await until_shown(pilot, reason)
            assert "What to do: The run does this now: redo-set (attempt 2)." in shown(pilot)
            await press(pilot, "enter")


async def test_a_run_that_could_not_begin_says_why(cell: Cell, run: ToldRun, opened: Opened) -> None:
    run.begin(cell)
    run.tell(HostFailed(problem="the cell is in use", action="Wait for it", exit_code=5))
    async with opened(ToldWorkplace(cell, run=run)) as pilot:
        await until_shown(pilot, "What to do: Wait for it")


async def test_the_end_of_a_run_is_told_once_and_how_to_go_on(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        run.record([events.Interrupted(reason="aborted", exit_code=130)])
        run.tell(StatusChanged(status=Status.ENDED), HostFailed(problem="aborted", exit_code=130))
        await until_shown(pilot, "The run ended early")
        await press(pilot, "enter")
        await until_shown(pilot, "ended early: aborted")
        assert "2 Preflight resumes it with r" in shown(pilot)


async def test_a_run_whose_process_dies_is_not_shown_as_running(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        run.end()
        await until_shown(pilot, "the process of the run is gone without a word")
        await press(pilot, "enter")
        await until_shown(pilot, "ENDED")


async def test_quitting_asks_what_becomes_of_the_run(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        await until_shown(pilot, "point 5")
        await press(pilot, "q", "escape")
        assert run.left == []
        await press(pilot, "q", "l")
        await until(lambda: run.left == [True])


async def test_quitting_may_stop_the_run(
    cell: Cell, run: ToldRun, history: tuple[events.Event, ...], opened: Opened
) -> None:
    async with opened(workplace_of(cell, run, history[:300])) as pilot:
        await until_shown(pilot, "point 5")
        await press(pilot, "q", "s")
        await until(lambda: run.left == [False])


@pytest.mark.sample("s-optimise", "r-resume")
@pytest.mark.parametrize(
    ("key", "what"),
    [
        ("s", "optimise"),
        ("k", "check"),
        ("K", "quick"),
        ("r", "resume"),
        ("l", "length"),
        ("L", "optimise with length check"),
    ],
)
async def test_a_run_begins_only_after_everything_was_looked_at(
    key: str, what: str, cell: Cell, run: ToldRun, opened: Opened
) -> None:
    run.begin(cell)
    workplace = ToldWorkplace(cell, live=[snapshot()], started=run)
    async with opened(workplace) as pilot:
        await press(pilot, "2", key)
        await until_shown(pilot, "calibration")
        assert workplace.begun == [what]
        assert workplace.checked == [what]
        assert pilot.app.current_mode == "measure"


async def test_no_run_begins_while_something_does_not_hold(
    cell: Cell, run: ToldRun, opened: Opened
) -> None:
    found = ChecklistItem(Mark.FAILED, "gauge y", "it answers in inch", "Press the in/mm key")
    workplace = ToldWorkplace(cell, started=run, preflight=Preflight((found,), is_ready=False))
    async with opened(workplace) as pilot:
        await press(pilot, "2", "s")
        await until_shown(pilot, "not everything holds that must hold")
        await press(pilot, "enter")
        assert "NO  gauge y: it answers in inch" in shown_list(pilot, "#checklist")
        assert "-> Press the in/mm key" in shown_list(pilot, "#checklist")
        assert workplace.begun == []


async def test_a_run_that_is_over_is_in_the_history(cell: Cell, run: ToldRun, opened: Opened) -> None:
    run.begin(cell)
    workplace = ToldWorkplace(cell, run=run)
    async with opened(workplace) as pilot:
        app = pilot.app
        assert isinstance(app, TechnicianApp)
        assert app.model is not None
        workplace.entries = (past_run("2026-03-02T080000Z"),)
        run.tell(StatusChanged(status=Status.ENDED))
        run.end()
        backend = app.model
        await until(lambda: backend.runs == workplace.entries)


async def test_quitting_without_a_run_asks_nothing(cell: Cell, opened: Opened) -> None:
    async with opened(ToldWorkplace(cell, live=[snapshot()])) as pilot:
        await pilot.press("q")
        await until(lambda: pilot.app.return_code == 0)


def shown_list(pilot: Pilot[int], place: str) -> str:
    return pilot.app.screen.query_one(place, TextList).text
