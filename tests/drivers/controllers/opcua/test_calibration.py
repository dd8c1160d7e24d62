"""A robot that a PLC moves is calibrated, as well as one that LinuxCNC moves."""

import asyncio
from dataclasses import replace
from pathlib import Path

import numpy as np

from drivers.simulated.cell import SimulatedCell
from hexacell.errors import ExitCode
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import calibrate
from hexacell.verdict.decision import Verdict
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase
from procedures.run.state import fold
from tests.drivers.controllers.opcua.plc import PlcServer, with_plc
from tests.hexacell.services.conftest import maker, order_of
from tests.small_cell import few_candidates


async def test_it_passes(tmp_path: Path) -> None:
    cell, folder = maker(tmp_path)(), RunFolder(tmp_path / "run")
    with few_candidates(), SimulatedCell(cell.settings, cell.config_paths) as simulated:
        plc = await asyncio.to_thread(PlcServer, simulated.machine)
        try:
            settings = with_plc(simulated.settings, plc)
            ended = await calibrate(order_of(replace(cell, settings=settings), folder))
        finally:
            await asyncio.to_thread(plc.close)
    assert ended.exit_code == ExitCode.DONE, ended
    state = fold(read_journal(folder.journal))
    assert state.judged
    assert state.judged.verdict is Verdict.PASS
    before, after = (np.linalg.norm(state.held_out(phase), axis=1) for phase in (Phase.BEFORE, Phase.AFTER))
    assert before.mean() > 1.0
    assert after.mean() < 0.2  # as in tests/hexacell/services/test_calibrate.py, by linuxcncrsh
