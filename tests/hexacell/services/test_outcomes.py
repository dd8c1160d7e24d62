"""Failures at the end of a run, through real drivers: the controller's config is correct in each case."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from hexacell.cell.fields import CertificateSettings
from hexacell.cell.simulation import SimulatedFault
from hexacell.config.change import ConfigChange
from hexacell.errors import AnswerNeeded, DeviceError, ExitCode, FileError, LimitError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.robot.model import robot_of
from hexacell.services.run.calibration_run import run_started
from hexacell.verdict.acceptance_gates import AcceptanceGate
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Calibration, Mode
from procedures.run.keys import Phase
from procedures.steps import events
from tests.geometries import hexaglide_geometry
from tests.small_cell import FEW_CHOICES

DOUBTFUL = AcceptanceGate(name="small", passed=False, sentence="It is 20 mm.", needs_person=True)
FORBIDDEN = AcceptanceGate(name="within tolerance", passed=False, sentence="Beyond: l3 (-13.00 mm).")


def at(kind: type[Any], action: Callable[[], Any]) -> Any:
    """A listener that does something once, at the first event of a kind."""
    done: list[bool] = []

    def listener(event: events.Event, _: object) -> None:
        if isinstance(event, kind) and not done:
            done.append(True)
            action()

    return listener


@pytest.fixture
def proposed(finished, make_site) -> Callable[..., Any]:
    """A site whose run has come to its proposal, with these gates or those that it had."""

    def make(gates: Sequence[AcceptanceGate] | None = None, **changes: Any) -> Any:
        site = make_site(**changes)
        history = list(finished.until(events.Proposed))
        if gates is not None:
            history[-1] = history[-1].model_copy(update={"gates": tuple(gates)})
        site.write(history, finished)
        return site

    return make


async def test_a_run_resumed_from_its_proposal_writes_the_config(proposed, finished) -> None:
    site = proposed()
    assert (await site.calibrate(resume=True)).exit_code == ExitCode.DONE
    assert site.config == finished.cell.config_path.read_bytes()


async def test_a_forbidding_gate_refuses_the_proposal(proposed, finished) -> None:
    site = proposed([FORBIDDEN])
    with pytest.raises(LimitError, match="refused: Beyond: l3") as refusal:
        await site.calibrate(resume=True)
    assert refusal.value.exit_code is ExitCode.OUT_OF_LIMITS
    assert site.config == finished.config_before


async def test_a_gate_that_requires_approval_ends_an_unattended_run(proposed, finished) -> None:
    site = proposed([DOUBTFUL])
    with pytest.raises(AnswerNeeded, match="It is 20 mm") as refusal:
        await site.calibrate(resume=True)
    assert refusal.value.exit_code is ExitCode.ANSWER_NEEDED
    assert site.config == finished.config_before
    assert (
        ConfigChange.load(site.folder.proposal).text_after.encode()
        == finished.cell.config_path.read_bytes()
    )


async def test_a_gate_that_requires_approval_is_approved_by_the_operator(proposed, approver) -> None:
    site = proposed([DOUBTFUL])
    assert (await site.calibrate(resume=True, operator=approver)).exit_code == ExitCode.DONE
    assert site.happened(events.Committed) == [events.Committed(approved_by="a tester")]


async def test_what_rests_on_an_expired_certificate_needs_a_person(finished, make_site) -> None:
    first, *others = finished.cell.settings.gauges
    certified = first.model_copy(update={"certificate": CertificateSettings(number="17", due="2020-01-01")})
    site = make_site(gauges=(certified, *others))
    history = list(finished.until(events.Proposed))[:-2]
    history[0] = history[0].model_copy(update={"expired": ("gauge x",)})
    site.write(history, finished)
    with pytest.raises(AnswerNeeded, match="The certificate has expired: gauge x"):
        await site.calibrate(resume=True)
    assert site.config == finished.config_before


def test_a_run_notes_which_certificates_have_expired_when_it_begins(finished) -> None:
    first, *others = finished.cell.settings.gauges
    stated = {"2020-01-01": ("gauge x",), "2999-12-31": ()}
    for due, expired in stated.items():
        certificate = CertificateSettings(number="17", due=due)
        gauges = (first.model_copy(update={"certificate": certificate}), *others)
        settings = finished.cell.settings.model_copy(update={"gauges": gauges})
        cell = replace(finished.cell, settings=settings)
        calibration = Calibration(settings, robot_of(finished.cell), Mode.OPTIMISE, effort=FEW_CHOICES)
        assert run_started(cell, calibration, ()).expired == expired


def bend(site: Any, millimetres: float) -> None:
    """Somebody leans on the machine: its true geometry is another from now on."""
    physics = site.simulated.physics
    bent = physics._truth.vector + millimetres * np.sin(np.arange(42.0))
    with physics._lock:
        physics._truth = Geometry(HEXAGLIDE_PARAMETERS, bent)
        physics._joints = physics._joints + np.nan  # so that the platform is moved along at once


async def test_a_result_that_verification_refuses_is_rolled_back_bit_for_bit(proposed, finished) -> None:
    site = proposed()
    # So little that the gauges still follow, whichever poses the records led to.
    ended = await site.calibrate(at(events.Committed, lambda: bend(site, 0.5)), resume=True)
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert "rolled back, the controller has its old config" in ended.line
    assert site.happened(events.ResultValidated)[0].verdict is not Verdict.PASS
    assert site.config == finished.config_before
    assert site.simulated.machine._geometry.geometry.largest_difference(_drawing(site)) == 0.0


def _drawing(site: Any) -> Geometry:
    nominal = site.cell.settings.robot.nominal.model_dump()
    return hexaglide_geometry(nominal["S"], nominal["B"], nominal["l"])


async def test_a_better_result_that_held_out_records_contradict_is_rolled_back(proposed, finished) -> None:
    site = proposed()
    ended = await site.calibrate(at(events.Committed, lambda: bend(site, 0.05)), resume=True)
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    judged = site.happened(events.ResultValidated)[0]
    assert judged.verdict is Verdict.NOT_EVALUATED
    assert not judged.verification.is_worse
    assert site.config == finished.config_before


async def test_a_failed_reload_restores_the_config_and_the_controller(proposed, finished, tmp_path) -> None:
    first_time = tmp_path / "tried"
    once = f"test -e {first_time} || {{ touch {first_time}; exit 1; }}"
    site = proposed(controller__reload_command=("sh", "-c", once))
    with pytest.raises(WriteBackUndone, match=r"its config is restored$") as undone:
        await site.calibrate(resume=True)
    assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
    assert site.config == finished.config_before
    assert site.simulated.controller.state.enabled
    assert site.simulated.machine._geometry.geometry.largest_difference(_drawing(site)) == 0.0
    assert not site.happened(events.Committed)


async def test_a_controller_that_never_reloads_must_be_restarted(proposed, finished) -> None:
    site = proposed(controller__reload_command=("false",))
    with pytest.raises(WriteBackUndone, match="Restart the controller before it moves"):
        await site.calibrate(resume=True)
    assert site.config == finished.config_before


@pytest.mark.parametrize("is_before", [True, False], ids=["before resuming", "during the run"])
async def test_an_edited_config_is_not_overwritten(proposed, is_before: bool) -> None:
    site = proposed()
    edited = site.config + b"# somebody was here\n"
    edit = partial(site.cell.config_path.write_bytes, edited)
    if is_before:
        edit()
    with pytest.raises(FileError, match="changed since the run began") as refusal:
        await site.calibrate(at(events.StepBegun, edit), resume=True)
    assert refusal.value.exit_code is ExitCode.USAGE
    assert site.config == edited


async def test_a_gauge_set_to_inches_stops_the_run(make_site) -> None:
    site = make_site()
    indicator = site.simulated.gauges.indicators["z"]
    fault = at(events.RecordTaken, lambda: setattr(indicator, "inch", True))
    with pytest.raises(DeviceError, match=r"gauge z: answers in inch\. Press its in/mm key") as refusal:
        await site.calibrate(fault)
    assert refusal.value.exit_code is ExitCode.HARDWARE
    (interrupted,) = site.happened(events.Interrupted)
    assert interrupted.exit_code == ExitCode.HARDWARE
    assert "answers in inch" in interrupted.reason
    assert b"z" in site.folder.wire.read_bytes()


async def test_two_gauges_that_fail_at_once_are_both_named(make_site) -> None:
    site = make_site()

    def press_both_keys() -> None:
        for name in "xz":
            site.simulated.gauges.indicators[name].inch = True

    with pytest.raises(DeviceError, match=r"(?s)gauge x: .*gauge z: "):
        await site.calibrate(at(events.RecordTaken, press_both_keys))
    (interrupted,) = site.happened(events.Interrupted)
    assert interrupted.exit_code == ExitCode.HARDWARE


async def test_an_emergency_stop_during_a_move_stops_the_run_and_is_not_reset(make_site) -> None:
    site = make_site()

    def stop_in_the_next_move() -> None:
        schedule = site.simulated.schedule
        schedule.schedule(SimulatedFault(kind="emergency stop", at_move=schedule.move_count + 1))

    with pytest.raises(DeviceError, match="controller") as refusal:
        await site.calibrate(at(events.RecordTaken, stop_in_the_next_move))
    assert refusal.value.exit_code is ExitCode.HARDWARE
    arrived = [event.orientation for event in site.happened(events.Arrived)]
    assert arrived in ([1], [1, 2]), "the move in which it struck may just have ended"
    with pytest.raises(AnswerNeeded, match=r"is in emergency stop, .* reset it at the controller"):
        await site.calibrate(resume=True)
    assert site.simulated.controller.state.estop
    assert not site.simulated.controller.state.enabled


async def test_unattended_a_controller_is_not_homed_without_the_word_of_the_cell_file(make_site) -> None:
    site = make_site(simulation__startup=("reset-estop", "switch-on"))
    with pytest.raises(
        AnswerNeeded, match=r'is not homed, .*Add "home" to startup in \[controller\]'
    ) as no:
        await site.calibrate()
    assert no.value.exit_code is ExitCode.ANSWER_NEEDED
    assert site.simulated.controller.state.enabled
    assert not site.simulated.controller.state.homed
    assert site.simulated.schedule.move_count == 0


async def test_a_gauge_moved_away_while_measuring_gives_rejected_records(make_site) -> None:
    """Its plunger is at an end: the record is rejected, the run continues, and the drift ends the run."""
    site = make_site(acceptance__drift_mm=0.05)

    def push() -> None:
        site.simulated.physics.gauges.station += np.array([0.0, 8.0, 0.0])

    with pytest.raises((LimitError, DeviceError)):
        await site.calibrate(at(events.RecordTaken, push))
    refused = site.happened(events.RecordRejected)
    assert refused
    assert {event.at.phase for event in refused} == {Phase.IDENTIFY}
    assert all("gauge y" in event.reason for event in refused)
