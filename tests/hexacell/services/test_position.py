"""A controller that is wrong about where the robot is: nothing moves, and the odd report is named."""

from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.interfaces import StartupAction
from hexacell.cell.loader import Cell
from hexacell.errors import DeviceError, ExitCode, Interruption, WriteBackUndone
from hexacell.services.devices.device_setup import open_devices
from hexacell.services.run.calibration_run import preflight
from hexacell.verdict.model_evidence import ZEROS_DOUBTED
from procedures.calibration.calibration import Mode
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from tests.procedures.runs.listening import failing, stop_here
from tests.small_cell import changed


def edit(cell: Cell) -> None:
    """A leg that is a tenth of a millimetre longer in the file."""
    text = cell.config_path.read_text()
    assert text.count("615.0") == 2
    cell.config_path.write_text(text.replace("615.0", "615.1", 1))


@pytest.mark.slow
async def test_a_pose_of_home_after_a_failed_kinematics_is_not_believed(make_site) -> None:
    """The move was carried out and the pose is that of home; no resumption moves on from there."""
    site = make_site()
    fail = failing("P1/o04/move", lambda: site.simulated.faults.inject("forward kinematics", "controller"))
    with pytest.raises(GuardTripped, match="forward kinematics failed") as tripped:
        await site.calibrate(fail)
    assert tripped.value.trip.guard is Guard.POSITION
    assert tripped.value.exit_code is ExitCode.HARDWARE
    moves = site.simulated.schedule.move_count
    with pytest.raises(GuardTripped, match=r"reports the pose X100\.000 Y-100\.000 Z500\.000"):
        await site.calibrate(resume=True)
    assert site.simulated.schedule.move_count == moves, "nothing moved"
    site.simulated.faults.clear("forward kinematics", "controller")
    assert (await site.calibrate(resume=True)).exit_code == ExitCode.DONE
    located = site.happened(events.Located)[-1]
    assert located.joints == pytest.approx(located.encoders, abs=0.1)


async def test_a_config_that_the_controller_does_not_run_is_found_before_the_first_move(make_site) -> None:
    site = make_site()
    site.simulated.faults.inject("old config", "controller")
    edit(site.cell)
    with pytest.raises(GuardTripped, match=r"runs another geometry than this file") as odd:
        await site.calibrate()
    assert str(site.cell.config_path) in str(odd.value)
    assert site.simulated.schedule.move_count == 0
    assert [event.guard for event in site.happened(events.Tripped)] == [Guard.POSITION]


async def homed(site: Any) -> Cell:
    cell: Cell = site.order().cell
    async with open_devices(cell.settings) as connected:
        assert isinstance(connected.devices.controller, LinuxcncrshController)
        assert await connected.devices.controller.position() is None, "it is not homed yet"
        await connected.devices.controller.prepare(frozenset(StartupAction))
    return cell


async def test_preflight_finds_it_once_the_controller_is_homed(make_site) -> None:
    site = make_site()
    cell = await homed(site)
    await preflight(cell, Mode.OPTIMISE, unattended=True)
    edit(cell)
    with pytest.raises(GuardTripped, match="it runs another geometry than this file has"):
        await preflight(cell, Mode.OPTIMISE, unattended=True)


async def test_preflight_names_an_encoder_that_the_controller_contradicts(make_site) -> None:
    site = make_site()
    cell = await homed(site)
    wrong = changed(cell.settings, {"encoders.offset": (0.0, 0.0, 0.0, -12.0, 0.0, 0.0)})
    cell = replace(cell, settings=wrong)
    with pytest.raises(GuardTripped, match=r"encoder 4: shows slider 4 at .* where the controller's pose"):
        await preflight(cell, Mode.OPTIMISE, unattended=True)


async def test_an_offset_of_the_controller_is_found_by_preflight_before_it_is_homed(make_site) -> None:
    site = make_site()
    cell = site.order().cell
    state = site.simulated.controller.state
    state.modes = replace(state.modes, offset=(0.0, 0.0, 3.0, 0.0, 0.0, 0.0))
    for find in (partial(preflight, cell, Mode.OPTIMISE, unattended=True), site.calibrate):
        with pytest.raises(DeviceError, match=r"adds an offset of 0 0 3 0 0 0 to"):
            await find()
    assert site.simulated.schedule.move_count == 0
    assert not state.homed
    assert state.estop


async def test_a_controller_that_counts_in_inches_measures_with_the_new_geometry(finished, make_site):
    site = make_site(**{"controller.unit_mm": 25.4})
    site.write(finished.until(events.Proposed), finished)
    assert (await site.calibrate(resume=True)).exit_code == ExitCode.DONE
    located = site.happened(events.Located)[-1]
    assert located.joints == pytest.approx(located.encoders, abs=0.1)


async def test_a_controller_that_keeps_its_old_config_gets_the_file_back(finished, make_site) -> None:
    site = make_site()
    site.write(finished.until(events.Proposed), finished)
    site.simulated.faults.inject("old config", "controller")
    with pytest.raises(WriteBackUndone, match="it runs another geometry") as undone:
        await site.calibrate(resume=True)
    assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
    assert site.config == finished.config_before
    assert site.simulated.schedule.move_count == 0


@pytest.mark.parametrize("includes_zeros", [pytest.param(False, marks=pytest.mark.slow), True])
async def test_encoders_that_the_controller_reads_need_not_be_homed_before_a_run(make_site, includes_zeros):
    controller = {"controller.joints_include_zeros": includes_zeros}
    site = make_site(**{"encoders.protocol": "controller"} | controller)
    cell = site.order().cell
    await preflight(cell, Mode.OPTIMISE, unattended=True)
    assert not site.simulated.controller.state.homed

    with pytest.raises(Interruption, match="enough"):
        await site.calibrate(failing("P1/o03/move", stop_here))
    await preflight(cell, Mode.OPTIMISE, unattended=True)
    located = site.happened(events.Located)[-1]
    assert located.joints == pytest.approx(located.encoders, abs=0.1)


@pytest.mark.slow
async def test_zeros_that_the_controller_does_not_run_are_not_calibrated_with(make_site) -> None:
    """No report contradicts another before they are written; then the held-out records do."""
    zeros = {"controller.joints_include_zeros": True}
    site = make_site(**{"encoders.protocol": "controller"} | zeros)
    cell = await homed(site)
    text = cell.config_path.read_text()
    assert text.count("[0.0, -155.0, 0.0],  # leg 1") == 1
    cell.config_path.write_text(
        text.replace("[0.0, -155.0, 0.0],  # leg 1", "[0.5, -155.0, 0.0],  # leg 1")
    )
    edited = site.config
    ended = await site.calibrate()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert "(The held-out records are " in ended.line
    assert ZEROS_DOUBTED.rstrip(".") in ended.line
    assert site.config == edited
