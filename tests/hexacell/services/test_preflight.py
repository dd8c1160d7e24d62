"""Preflight: the robot does not move, and nothing is left behind."""

import asyncio

import numpy as np
import pytest

from hexacell.campaign import feasibility
from hexacell.errors import CellBusy
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.run.calibration_run import preflight
from procedures.calibration.calibration import Mode


async def check(site):
    return await preflight(site.order().cell, Mode.OPTIMISE, unattended=True)


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
