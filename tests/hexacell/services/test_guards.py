"""A fault during a move stops the robot, in the whole program with real drivers and the journal."""

from collections.abc import Callable
from typing import Any

import pytest

from hexacell.cell.recovery import UnattendedRecovery
from hexacell.cell.simulation import FaultKind, SimulatedFault
from hexacell.errors import ExitCode
from hexacell.services.run.calibration_run import preflight
from procedures.calibration.calibration import Mode
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from tests.injection_times import injection_times
from tests.small_cell import changed

GIVES_UP = UnattendedRecovery(**dict.fromkeys(UnattendedRecovery.model_fields, ("abort",)))
SLOW: dict[str, Any] = {"recovery__unattended": GIVES_UP, "timing__clock_factor": 20.0}
LONG_S, SHORT_S = 200.0, 20.0
"""The move in which something happens lasts ten seconds on the wall, which the slowest machine sees."""
SEEN_ON_ARRIVAL = {"encoder 2", "encoder 4"}

IN_A_SET, TO_A_POINT = "P1/o02/move", "P1/o01/move"
FAULTS = [
    ("stop line", "", IN_A_SET, {Guard.STOP_LINE}),
    ("stop line", "", TO_A_POINT, {Guard.STOP_LINE}),
    ("emergency stop", "controller", IN_A_SET, {Guard.EMERGENCY_STOP}),
    ("following error", "controller", TO_A_POINT, {Guard.FOLLOWING}),
    ("at its end", "x", IN_A_SET, {Guard.GAUGE_END}),
    ("off its plate", "z", IN_A_SET, {Guard.PLATE, Guard.GAUGE_END}),
    ("unplugged", "x", IN_A_SET, {Guard.DEVICE}),
    ("alarm", "encoder 3", TO_A_POINT, {Guard.ENCODERS}),
    ("warning", "encoder 6", IN_A_SET, {Guard.ENCODERS}),
    ("frozen", "encoder 2", IN_A_SET, {Guard.FOLLOWING}),
    ("jumped", "encoder 4", IN_A_SET, {Guard.FOLLOWING, Guard.ENCODERS}),
    ("unplugged", "encoder 5", IN_A_SET, {Guard.ENCODERS}),
    ("unplugged", "controller", IN_A_SET, {Guard.DEVICE}),
    ("frozen", "controller", IN_A_SET, {Guard.STALE}),
]


def striking(site: Any, key: str, kind: FaultKind, device: str) -> Callable[..., None]:
    """A listener that has something go wrong in the middle of a long move."""
    physics = site.simulated.physics

    def listener(event: events.Event, _: object) -> None:
        if isinstance(event, events.StepBegun) and event.step.key == key:
            lasts_s = SHORT_S if device in SEEN_ON_ARRIVAL else LONG_S
            physics._settings = changed(physics._settings, {"motion.minimum_s": lasts_s})
            schedule = site.simulated.schedule
            fault = {"kind": kind, "device": device, "at_move": schedule.move_count + 1, "after_s": 5.0}
            schedule.schedule(SimulatedFault.model_validate(fault))

    return listener


@pytest.mark.sample(
    "stop line-*",
    "emergency stop-*",
    "at its end-*",
    "unplugged-x-*",
    "frozen-encoder*",
    "unplugged-controller-*",
)
@pytest.mark.parametrize(("kind", "device", "key", "guards"), FAULTS)
async def test_a_fault_during_a_move_stops_the_robot_and_trips_its_guard(
    make_site, kind, device, key, guards
) -> None:
    # A busy machine pauses for longer than the first.
    patience = {
        "guards__stale_s": 0.4 if guards == {Guard.STALE} else 10.0,
        "encoders__timeout_s": 0.5 if device == "encoder 5" else 10.0,
    }
    site = make_site(**SLOW, **patience, guards__following=0.2)
    before = site.config
    struck_s = injection_times(site.simulated)
    with pytest.raises(GuardTripped) as tripped:
        await site.calibrate(striking(site, key, kind, device))
    assert tripped.value.trip.guard in guards
    assert tripped.value.exit_code is ExitCode.HARDWARE
    assert site.config == before
    told, interrupted = site.happened(events.Tripped), site.happened(events.Interrupted)
    assert [event.guard for event in told] == [tripped.value.trip.guard]
    assert interrupted[-1].reason == str(tripped.value)
    # The first point is where the robot stands already: it may be there before it is stopped.
    assert key in [event.step.key for event in site.happened(events.StepBegun)][-3:]
    assert len(struck_s) == 1
    if device == "controller" and kind in {"unplugged", "frozen"}:
        assert str(tripped.value).startswith("PRESS THE EMERGENCY STOP. The robot could not be stopped")
    elif device not in SEEN_ON_ARRIVAL:
        motion = site.simulated.physics._motion
        assert motion.end_s < motion.start_s + LONG_S, "it was stopped on the way"


async def test_preflight_fails_while_the_stop_file_exists(make_cell) -> None:
    cell = make_cell(guards__stop_file="stop")
    (cell.path.parent / "stop").touch()
    with pytest.raises(GuardTripped, match=r"stop line: motion is forbidden: .*stop exists\. Release it"):
        await preflight(cell, Mode.OPTIMISE, unattended=True)
    (cell.path.parent / "stop").unlink()
    await preflight(cell, Mode.OPTIMISE, unattended=True)
