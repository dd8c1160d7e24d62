"""Every screen at two sizes, those with every colour in three themes: pictures that must stay the same."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace

import pytest
from textual.widgets import Input

from hexacell.cell.limits import ExclusionSettings
from hexacell.cell.loader import Cell, load_cell
from hexacell.cell.recovery import Action, FailureKind
from hexacell.errors import FileError
from hexacell.kinematics.pose import Pose
from hexacell.results.run_comparison import ParameterTrend
from hexacell.run_process.messages import StatusChanged
from hexacell.screen.app import TechnicianApp
from hexacell.screen.child import Preflight, TriedPlan
from hexacell.screen.further_screens import AssistantScreen
from hexacell.screen.preferences import THEMES
from hexacell.services.history.run_index import PastRun
from hexacell.text.screens.views import ChecklistItem, Mark
from hexacell.verdict.acceptance_gates import AcceptanceGate
from hexacell.verdict.decision import JudgedError, Verdict, VerifiedAccuracy
from procedures.engine.command_loop import Status
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import PendingChange, ask_approval, ask_placement, ask_recovery
from procedures.steps import events
from tests.screen.animation import animated
from tests.screen.conftest import (
    SNAPSHOTS,
    UPDATE,
    compare_with_kept,
    compare_with_snapshot,
    settled_picture,
)
from tests.screen.test_found_terms import told
from tests.screen.test_job import press, until_shown, workplace_of
from tests.screen.test_plan_screen import tried
from tests.screen.told_run import ToldRun, ToldWorkplace, past_run, snapshot
from tests.waiting import until

DOCS = SNAPSHOTS.parents[2] / "docs"
SIZES = {"80x24": (80, 24), "140x40": (140, 40)}
COLOURED = {"cell", "review", "history", "approve", "fault"}
"""Pictures that have every colour of a theme between them: at the larger size compared in all themes."""

MEASURED = 262
"""Events until the fourth point is nearly measured; PROPOSED until the change waits for approval."""
PROPOSED, COMMITTED = 455, 457

DIFF = """\
--- simulated-hexaglide.controller.toml
+++ proposed
@@ -12,6 +12,6 @@
 S = [
-  [0.0, -160.0, 0.0],
+  [4.871475, -164.490216, 7.355836],
"""


def judged(
    name: str, mode: str, verdict: Verdict, mm: float, expanded_mm: float, *, is_in_controller: bool = False
) -> PastRun:
    error = JudgedError(value=mm, expanded=expanded_mm, limit=0.3, verdict=verdict)
    accuracy = VerifiedAccuracy(
        position=error, orientation=error, poses=6, task_named=True, worst=(0.0,) * 6
    )
    return past_run(
        name, is_in_controller=is_in_controller, mode=mode, verdict=verdict, accuracy=accuracy, is_over=True
    )


def idle(cell: Cell) -> ToldWorkplace:
    checks = [
        judged(f"2026-03-{day:02}T023000Z", "check", Verdict.PASS, mm, 0.080)
        for day, mm in enumerate((0.041, 0.055, 0.038, 0.062, 0.148, 0.153), start=3)
    ]
    entries = (
        judged("2026-03-09T023000Z", "check", Verdict.CONDITIONAL_PASS, 0.231, 0.080),
        *reversed(checks),
        judged("2026-03-02T080000Z", "optimise", Verdict.PASS, 0.034, 0.090, is_in_controller=True),
        judged("2026-02-02T073000Z", "optimise", Verdict.PASS, 0.040, 0.088),
        judged("2026-01-05T074500Z", "optimise", Verdict.PASS, 0.037, 0.091),
    )
    trends = [
        ParameterTrend("B2y", "mm", (-67.395, -67.384, -67.374), (0.009,) * 3, 0.00037, 0.00022),
        ParameterTrend("l4", "mm", (610.612, 610.668, 610.723), (0.011,) * 3, 0.00198, 0.00028),
    ]
    return ToldWorkplace(
        cell,
        live=[snapshot(y={"problem": "gauge y: it does not answer. Look at its cable", "age_s": 12.0})],
        entries=entries,
        trends=trends,
        preflight=Preflight(
            items=(
                ChecklistItem(Mark.DONE, "points and poses within reach"),
                ChecklistItem(Mark.FAILED, "disk", "48 MB are free, a run needs 200", "Free some"),
            ),
            is_ready=False,
        ),
        plan=TriedPlan(
            lines=(
                "55 records will give about 0.062 mm at the worst of your task poses, in about 24 minutes.",
            )
        ),
    )


def running(cell: Cell, history: History, count: int) -> tuple[ToldRun, ToldWorkplace]:
    run = ToldRun()
    return run, workplace_of(cell, run, history[:count])


History = tuple[events.Event, ...]
Pictures = dict[str, tuple[str, ...]]
"""Keys that lead to each picture from the one before."""

Opening = tuple[ToldWorkplace, Pictures]


def changed(cell: Cell, section: str, **values: object) -> Cell:
    """A cell with other values in a section of its file."""
    part = getattr(cell.settings, section).model_copy(update=values)
    return replace(cell, settings=cell.settings.model_copy(update={section: part}))


def scene_plan(cell: Cell, _: History) -> Opening:
    workplace, plan = idle(cell), tried(cell)
    pose = plan.poses[1][2].as_tuple()
    exclusions = (ExclusionSettings(pose=pose, within_deg=5.0), ExclusionSettings(point=4))
    workplace.plan = plan
    workplace.cell = replace(cell, settings=cell.settings.model_copy(update={"exclusions": exclusions}))
    return workplace, {"plan": ("2", "x", "down", "down", "down")}


def scene_measure(cell: Cell, history: History) -> Opening:
    _, workplace = running(changed(cell, "identification", target_mm=0.1), history, MEASURED)
    return workplace, {"measure": ("3",), "digits": ("d",), "help": ("escape", "question_mark")}


def scene_review(cell: Cell, history: History) -> Opening:
    run, workplace = running(cell, told(history), len(history))
    run.tell(StatusChanged(status=Status.ENDED))
    accepted = cell.settings.acceptance.model_copy(update={"position_mm": 0.25})
    workplace.cell = replace(cell, settings=cell.settings.model_copy(update={"acceptance": accepted}))
    return workplace, {"review": ("4",)}


def scene_place(cell: Cell, history: History) -> Opening:
    run, workplace = running(cell, history, 5)
    run.tell(
        snapshot(
            x={"shown_mm": -1.2},
            z={
                "shown_mm": None,
                "age_s": None,
                "problem": "gauge z: it does not answer. Look at its cable",
            },
        )
    )
    run.ask(ask_placement(SetKey(phase=Phase.IDENTIFY, point=1), Pose(0.0, 0.0, 550.0)))
    return workplace, {"place": ()}


def scene_approve(cell: Cell, history: History) -> Opening:
    run, workplace = running(cell, history, PROPOSED)
    proposed = next(event for event in history if isinstance(event, events.Proposed))
    far = AcceptanceGate(
        name="within tolerance",
        passed=False,
        sentence="Beyond the drawing's tolerance: B3 z (+5.21 mm).",
        needs_person=True,
        needs_cell_name=True,
    )
    gates = tuple(far if gate.name == far.name else gate for gate in proposed.gates)
    run.ask(ask_approval(PendingChange(gates, DIFF, proposed.displacement), cell=cell.settings.name))
    return workplace, {"approve": ()}


def scene_fault(cell: Cell, history: History) -> Opening:
    run, workplace = running(cell, history, MEASURED)
    problem = "gauge y: its plunger is at the end of its travel. Move the gauge by 3.8 mm along +y"
    failed = {"failure": FailureKind.GAUGE_AT_END, "attempt": 1, "reason": problem, "action": Action.ASK}
    run.record([events.Failed(step=None, **failed)])
    run.tell(snapshot(y={"shown_mm": -6.1904}))
    run.ask(ask_recovery(problem, (Action.RETRY, Action.MEASURE_AGAIN, Action.REDO_SET, Action.ABORT)))
    run.tell(StatusChanged(status=Status.FAULTED))
    return workplace, {"fault": ()}


SCENES: dict[str, Callable[[Cell, History], Opening]] = {
    "idle": lambda cell, _: (
        idle(cell),
        {"cell": ("1",), "preflight": ("2", "v", "enter"), "history": ("5", "o")},
    ),
    "plan": scene_plan,
    "measure": scene_measure,
    "begun": lambda cell, history: (running(cell, history, 16)[1], {"begun": ("3",)}),
    "review": scene_review,
    "place": scene_place,
    "approve": scene_approve,
    "fault": scene_fault,
}


@pytest.mark.sample("80x24")
@pytest.mark.parametrize("size", SIZES)
async def test_the_assistant_looks_as_it_did_and_leaving_it_writes_nothing(size, tmp_path) -> None:
    path = tmp_path / "cell.toml"
    app = TechnicianApp(lambda: pytest.fail("there is no cell"), first_cell=path)
    async with app.run_test(size=SIZES[size]) as pilot:
        await until(lambda: isinstance(app.screen, AssistantScreen))
        await until_shown(pilot, "Question 1 of")
        app.screen.query_one(Input).value = ""
        await pilot.press("enter")
        await until_shown(pilot, "Please type an answer.")
        await compare_with_snapshot(f"assistant-{size}-dark", pilot)
        await pilot.press("x", "enter", "ctrl+q")
        await until(lambda: app.return_code is not None)
    with pytest.raises(FileError, match="does not exist"):
        load_cell(path)


@pytest.mark.sample("*-80x24")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scene", SCENES)
async def test_it_looks_as_it_did(scene, size, cell, history, opened) -> None:
    workplace, pictures = SCENES[scene](cell, history)
    async with opened(workplace, SIZES[size]) as pilot:
        for picture, keys in pictures.items():
            await press(pilot, *keys)
            for theme in reversed(THEMES if picture in COLOURED and size != "80x24" else THEMES[:1]):
                pilot.app.theme = theme
                await compare_with_snapshot(f"{picture}-{size}-{theme}", pilot)


RECORDED = {9: "1/1", 59: "1/4", 87: "1/11", 147: "2/11", 207: "3/11", 267: "4/11", 327: "5/11"}
"""Events after which the animated picture shows the run, and the record that is the latest then."""


async def test_the_animated_picture_shows_the_job_on_the_present_screens(cell, history, opened) -> None:
    run, workplace = running(changed(cell, "acceptance", position_mm=0.25), history, 5)
    async with opened(workplace, (110, 36)) as pilot:
        pictures = []
        run.ask(ask_placement(SetKey(phase=Phase.IDENTIFY, point=1), Pose(0.0, 0.0, 550.0)))
        for x_mm, z_mm, said in ((-3.2, 1.1, "3.2 mm in"), (0.1, 1.1, "✓ x"), (0.1, 0.0, "✓ z")):
            run.tell(snapshot(x={"shown_mm": x_mm}, z={"shown_mm": z_mm}))
            await until_shown(pilot, said)
            pictures.append(await settled_picture(pilot))
        run.close_question()
        await press(pilot, "3")
        for count, record in RECORDED.items():
            x, y, z = ({"shown_mm": mm} for mm in history[count - 1].reading.gauges_mm)
            run.tell(snapshot(x=x, y=y, z=z))
            run.record(history[run.events : count])
            await until_shown(pilot, record)
            pictures.append(await settled_picture(pilot))
        run.record(history[run.events :])
        run.tell(StatusChanged(status=Status.ENDED))
        await press(pilot, "4")
        await until_shown(pilot, "PASS")
        pictures.append(await settled_picture(pilot))
    seconds = [2.0, 1.5, 2.0, *[1.5] * len(RECORDED), 6.0]
    compare_with_kept(DOCS / "screen-job.svg", animated(pictures, seconds))


@pytest.mark.parametrize(
    ("page", "snapshot_name"),
    [
        ("screen-review", "review-140x40-light"),
        ("screen-place", "place-80x24-dark"),
        ("screen-plan", "plan-80x24-dark"),
        ("screen-history", "history-140x40-light"),
    ],
)
def test_the_pictures_in_the_docs_are_those_that_are_kept(page: str, snapshot_name: str) -> None:
    docs = DOCS / f"{page}.svg"
    kept = (SNAPSHOTS / f"{snapshot_name}.svg").read_text()
    if UPDATE in os.environ:
        docs.write_text(kept)
    assert docs.read_text() == kept
