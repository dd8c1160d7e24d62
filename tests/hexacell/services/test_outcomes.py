"""Failures at the end of a run, through real drivers: the controller's config is correct in each case."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.cell.fields import CertificateSettings
from hexacell.cell.simulation import SimulatedFault
from hexacell.errors import AnswerNeeded, DeviceError, ExitCode
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.robot.model import robot_of
from hexacell.services.run.calibration_run import run_started
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Calibration, Mode
from procedures.steps import events
from tests.geometries import hexaglide_geometry
from tests.procedures.runs.listening import on
from tests.small_cell import FEW_CHOICES


async def test_what_rests_on_an_expired_certificate_needs_a_person(finished, make_site) -> None:
    first, *others = finished.cell.settings.gauges

    def certified(due: str) -> tuple[Any, ...]:
        stated = CertificateSettings(number="17", due=due)
        return (first.model_copy(update={"certificate": stated}), *others)

    for due, expired in (("2020-01-01", ("gauge x",)), ("2999-12-31", ())):
        settings = finished.cell.settings.model_copy(update={"gauges": certified(due)})
        cell = replace(finished.cell, settings=settings)
        calibration = Calibration(settings, robot_of(finished.cell), Mode.OPTIMISE, effort=FEW_CHOICES)
        assert run_started(cell, calibration, ()).expired == expired
    site = make_site(gauges=certified("2020-01-01"))
    history = list(finished.until(events.Proposed))[:-2]
    history[0] = history[0].model_copy(update={"expired": ("gauge x",)})
    site.write(history, finished)
    with pytest.raises(AnswerNeeded, match="The certificate has expired: gauge x"):
        await site.calibrate(resume=True)
    assert site.config == finished.config_before


def bend(site: Any, millimetres: float) -> None:
    """Somebody leans on the machine: its true geometry is another from now on."""
    physics = site.simulated.physics
    machine = physics._machine
    bent = machine._geometry.vector + millimetres * np.sin(np.arange(42.0))
    with physics._lock:
        machine._geometry = Geometry(HEXAGLIDE_PARAMETERS, bent)
        before, physics._joints = physics._pose, physics._joints + np.nan
        physics._update()
        assert physics._pose is not before, "the platform is moved along at once"


def _drawing(site: Any) -> Geometry:
    nominal = site.cell.settings.robot.nominal.model_dump()
    return hexaglide_geometry(nominal["S"], nominal["B"], nominal["l"])


async def test_a_better_result_that_held_out_records_contradict_is_rolled_back_bit_for_bit(
    make_site, finished
) -> None:
    site = make_site()
    site.write(finished.until(events.Proposed), finished)
    # So little that the gauges still follow, whichever poses the records led to.
    ended = await site.calibrate(on(events.Committed, lambda: bend(site, 0.05)), resume=True)
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    judged = site.happened(events.ResultValidated)[0]
    assert judged.verdict is Verdict.NOT_EVALUATED
    assert not judged.verification.is_worse
    assert "rolled back, the controller has its old config" in ended.line
    assert site.config == finished.config_before
    assert site.simulated.machine._geometry.geometry.largest_difference(_drawing(site)) == 0.0


async def test_an_emergency_stop_during_a_move_stops_the_run_and_is_not_reset(make_site) -> None:
    site = make_site()

    def stop_in_the_next_move() -> None:
        schedule = site.simulated.schedule
        schedule.schedule(SimulatedFault(kind="emergency stop", at_move=schedule.move_count + 1))

    with pytest.raises(DeviceError, match="controller") as refusal:
        await site.calibrate(on(events.RecordTaken, stop_in_the_next_move))
    assert refusal.value.exit_code is ExitCode.HARDWARE
    arrived = [event.orientation for event in site.happened(events.Arrived)]
    assert arrived in ([1], [1, 2]), "the move in which it struck may just have ended"
    with pytest.raises(AnswerNeeded, match=r"is in emergency stop, .* reset it at the controller"):
        await site.calibrate(resume=True)
    assert site.simulated.controller.state.estop
    assert not site.simulated.controller.state.enabled


async def test_unattended_a_controller_is_not_homed_without_the_word_of_the_cell_file(make_site) -> None:
    site = make_site(simulation__startup=("reset-estop", "switch-on"))
    with pytest.raises(AnswerNeeded, match=r'is not homed, .*Add "home" to startup') as no:
        await site.calibrate()
    assert no.value.exit_code is ExitCode.ANSWER_NEEDED
    assert site.simulated.controller.state.enabled
    assert not site.simulated.controller.state.homed
    assert site.simulated.schedule.move_count == 0
