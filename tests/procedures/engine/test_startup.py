"""Who may make the controller ready: the cell file, a person, or nobody but a person at the controller."""

from typing import Any

import pytest

from drivers.interfaces import StartupAction, StartupActions
from hexacell.errors import AnswerNeeded, DeviceError, ExitCode, Interruption
from procedures.engine.commands import UnattendedOperator
from procedures.guards.guards import Guards
from procedures.resources.controller_config import Startup
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, apply, fold
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from tests.procedures.fakes import Approver, Bench

EVERYTHING = frozenset(StartupAction(word) for word in ("reset-estop", "switch-on", "home"))
NOTHING: StartupActions = frozenset()
COLD = [StartupAction.RESET_INITIAL_ESTOP, StartupAction.SWITCH_ON, StartupAction.HOME]
NEW = RunState()
P1 = SetKey(phase=Phase.IDENTIFY, point=1)
ESTOP = events.Tripped(guard=Guard.EMERGENCY_STOP, device="controller", problem="p", action="a")
ARRIVED = events.Arrived(at=P1, orientation=1, pose=(0.0,) * 6)
DONE = [action.value for action in COLD]


@pytest.fixture
def startup(make_rig: Any) -> Any:
    def make(stated: StartupActions, operator: Any, needed: list[StartupAction]) -> tuple[Startup, Bench]:
        rig = make_rig()
        rig.controller.needed = list(needed)
        guards: Guards = rig.performer.guards
        return Startup(rig.controller, guards, operator, stated), rig.bench

    return make


@pytest.mark.parametrize("state", [NEW, apply(fold([ESTOP]), ARRIVED)], ids=["new", "moved again"])
async def test_what_the_cell_file_states_is_done_without_asking(startup, state: RunState) -> None:
    """Also after an emergency stop that is over, as the robot has moved since."""
    starting, bench = startup(EVERYTHING, UnattendedOperator(), COLD)
    await starting.prepare(state)
    assert bench.controller.log == ["prepare", *DONE]


@pytest.mark.parametrize("needed", COLD)
async def test_unattended_what_is_not_stated_is_refused_with_the_key_to_set(startup, needed) -> None:
    starting, bench = startup(EVERYTHING - {needed}, UnattendedOperator(), [needed])
    key = rf'Add "{needed.value}" to startup in \[controller\]'
    with pytest.raises(AnswerNeeded, match=rf"^controller: is .*, and the run is unattended\. {key}") as no:
        await starting.prepare(NEW)
    assert no.value.exit_code is ExitCode.ANSWER_NEEDED
    assert bench.controller.log == ["prepare"]


async def test_a_person_is_asked_for_each(startup) -> None:
    person = Approver(startup=["yes"] * 3)
    starting, bench = startup(NOTHING, person, COLD)
    await starting.prepare(NEW)
    assert bench.controller.log[-3:] == DONE
    assert [problem.rpartition(". ")[2] for problem in person.problems] == [
        "Reset the emergency stop?",
        "Is nobody within its reach? Switch the machine on?",
        "Is its way free? Home it, which moves the machine?",
    ]


async def test_a_person_who_declines_ends_the_run_and_a_later_emergency_stop_needs_one(startup) -> None:
    starting, bench = startup(NOTHING, Approver(startup=["no"]), [StartupAction.HOME])
    with pytest.raises(Interruption, match="is not homed, which was left as it is"):
        await starting.prepare(NEW)
    assert bench.controller.log == ["prepare"]
    starting, bench = startup(EVERYTHING, UnattendedOperator(), [StartupAction.RESET_ESTOP])
    with pytest.raises(AnswerNeeded, match="reset it at the controller, then begin or resume"):
        await starting.prepare(NEW)
    starting, bench = startup(EVERYTHING, Approver(startup=["yes"]), [StartupAction.RESET_ESTOP])
    await starting.prepare(NEW)
    assert bench.controller.log[-1] == StartupAction.RESET_ESTOP.value, "before a run a person may say so"


RESETS = [StartupAction.RESET_INITIAL_ESTOP, StartupAction.RESET_ESTOP]


@pytest.mark.parametrize("needed", RESETS)
async def test_an_emergency_stop_during_the_run_is_reset_at_the_controller_only(startup, needed) -> None:
    person = Approver()
    starting, bench = startup(EVERYTHING, person, COLD)
    await starting.prepare(NEW)
    bench.controller.needed = [needed]

    async def ask(question: Any) -> str:
        person.problems.append(question.subject.request)
        if len(person.problems) == 2:
            bench.controller.needed = [StartupAction.SWITCH_ON]  # it was reset there
        return "yes"

    person.ask = ask  # type: ignore[method-assign]
    await starting.prepare(NEW)
    assert all("reset it at the controller; this program does not" in asked for asked in person.problems)
    assert len(person.problems) == 2, "saying so is not enough"
    assert bench.controller.log == ["prepare", *DONE, "prepare", "prepare", "prepare", "switch-on"]


@pytest.mark.parametrize("needed", RESETS)
async def test_it_is_not_reset_on_resuming_either(startup, needed) -> None:
    stopped = fold([ARRIVED, ESTOP, events.Interrupted(reason="p", exit_code=3)])
    starting, bench = startup(EVERYTHING, UnattendedOperator(), [needed])
    with pytest.raises(AnswerNeeded, match="reset it at the controller"):
        await starting.prepare(stopped)
    assert bench.controller.log == ["prepare"]


async def test_a_preparation_that_failed_may_have_reset_it_and_one_that_a_guard_prevented_not(startup):
    starting, bench = startup(EVERYTHING, UnattendedOperator(), COLD)
    bench.controller.failures["prepare"] = DeviceError("does not switch on", subject="controller")
    with pytest.raises(DeviceError, match="does not switch on"):
        await starting.prepare(NEW)
    with pytest.raises(AnswerNeeded, match="reset it at the controller"):
        await starting.prepare(NEW)
    starting, bench = startup(EVERYTHING, UnattendedOperator(), COLD)
    bench.encoders.failure = DeviceError("has an alarm", subject="encoder 3")
    with pytest.raises(GuardTripped, match="has an alarm"):
        await starting.prepare(NEW)
    bench.encoders.failure = None
    await starting.prepare(NEW)
    assert bench.controller.log == ["prepare", *DONE]


async def test_after_a_reload_the_cell_files_word_counts_but_not_for_an_emergency_stop(startup) -> None:
    starting, bench = startup(EVERYTHING, UnattendedOperator(), [])
    await starting.prepare(NEW)
    bench.controller.needed = list(COLD)
    await starting.reload()
    assert bench.controller.log == ["prepare", "reload", *DONE]
    starting, bench = startup(EVERYTHING, UnattendedOperator(), [StartupAction.RESET_ESTOP])
    with pytest.raises(AnswerNeeded, match="reset it at the controller"):
        await starting.reload()
    assert StartupAction.RESET_ESTOP.value not in bench.controller.log
