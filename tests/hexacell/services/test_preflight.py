"""Preflight: all failures are in one report, and the robot does not move."""

import asyncio

import numpy as np
import pytest
from pydantic import SecretStr

from hexacell.campaign import feasibility
from hexacell.errors import AnswerNeeded, CellBusy, DeviceError, ExitCode, ReachError, SeveralErrors
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.run.calibration_run import preflight
from procedures.calibration.calibration import Mode

FAR = (0.0, 0.0, 2000.0)
HASTY = {"encoders__timeout_s": 0.3}


async def check(site, *, unattended: bool = True):
    return await preflight(site.order().cell, Mode.OPTIMISE, unattended=unattended)


async def test_a_ready_cell_gives_its_devices_and_nothing_moves(make_site) -> None:
    site = make_site()
    before = site.simulated.machine.joints()
    site.simulated.physics.gauges.station += np.array([9.0, -9.0, 0.0])  # which is seen to when it runs
    identities = await check(site)
    names = [identity.name for identity in identities]
    assert names[:3] == ["x", "y", "z"]
    assert len(names) == 10
    assert site.simulated.machine.joints() == before
    assert not site.simulated.controller.state.enabled, "not even switched on"
    with cell_lock(site.cell.config_path), pytest.raises(CellBusy):
        await check(site)


async def test_every_failure_is_reported_at_once(make_site) -> None:
    good = (100.0, -100.0, 500.0)
    site = make_site(
        identification__points=(good, FAR),
        verification__points=(FAR, good),
        stations__placement="by-hand",
        **HASTY,
    )
    site.simulated.gauges.indicators["x"].inch = True
    site.simulated.gauges.indicators["z"].held_mm = 1.0
    site.simulated.faults.inject("unplugged", "encoder 4")
    wrong = {"connect_password": SecretStr("WRONG")}
    controller = site.simulated.settings.controller.model_copy(update=wrong)
    site.simulated.settings = site.simulated.settings.model_copy(update={"controller": controller})
    before = site.simulated.machine.joints()
    with pytest.raises(SeveralErrors) as refusal:
        await check(site)
    said = str(refusal.value)
    for words in (
        "identification point 2: leg 1 cannot reach",
        "verification point 1: leg 1 cannot reach",
        "the gauges are put at each point by hand",
        "gauge x: answers in inch",
        "gauge z: is on hold",
        "password",
    ):
        assert words in said
    kinds = [type(error) for error in refusal.value.errors]
    assert kinds[:3] == [ReachError, ReachError, AnswerNeeded]
    assert len(kinds) == 7
    assert all(issubclass(kind, DeviceError) for kind in kinds[3:])
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert site.simulated.machine.joints() == before


async def test_a_stop_during_the_checks_of_the_plan_leaves_nothing(make_site, monkeypatch) -> None:
    site = make_site()
    loop = asyncio.get_running_loop()
    run = asyncio.ensure_future(site.calibrate())

    def told_to_stop(_plan: object) -> tuple[()]:
        loop.call_soon_threadsafe(run.cancel)
        return ()

    monkeypatch.setattr(feasibility, "reach_failures", told_to_stop)
    with pytest.raises(asyncio.CancelledError):
        await run
    assert not site.folder.path.exists()
    assert not site.simulated.controller.state.enabled, "not even switched on"
    with cell_lock(site.cell.config_path):
        pass
