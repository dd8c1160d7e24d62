"""Whole runs of a cell whose encoders are three times as noisy as its file states.

The demo's robot, points and orientations, on fake devices. With the noise measured at the first reference
the residuals agree with it, and the verdict stands; with the stated noise the evidence fails. The limit is
0.3 mm, as twice the noise of the sliders is a larger U.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.errors import HexacellError
from hexacell.verdict.decision import Verdict
from procedures.journal.journal import read_journal
from procedures.run.state import RunState, fold
from tests.benchmarks.figures import NEVER, Figures, at_least, between
from tests.benchmarks.samples import sample
from tests.procedures.rig import new_rig

RUNS = sample(__name__, "RUNS")
MEASURED = {"noise__standstill_readings": 40, "noise__revisits": 6}
STATED = {"noise__standstill_readings": 0, "noise__revisits": 0}


def whole_run(folder: Path, seed: int, how: dict[str, Any]) -> RunState:
    """A run as far as it got."""
    bundled = load_cell(bundled_config("simulated-hexaglide")).settings
    changes: dict[str, Any] = {
        "identification__points": bundled.identification.points,
        "identification__orientations": 11,
        "verification__points": bundled.verification.points,
        "verification__orientations": 6,
        "noise__encoder": 0.01,
        "noise__gauge_mm": 0.01,
        "acceptance__position_mm": 0.3,
        "acceptance__orientation_deg": 0.1,
        "simulation__gauges__noise_mm": 0.01,
        "simulation__gauges__flicker_mm": 0.001,
        "simulation__encoders__noise": 0.03,
        "simulation__encoders__flicker": 0.001,
        "simulation__seed": seed,
    }
    rig = new_rig(folder, **(changes | how))
    with suppress(HexacellError):  # an uncertain estimate may take the ball off its plate
        asyncio.run(rig.run())
    return fold(read_journal(rig.folder.journal))


def ratio_of(state: RunState) -> float:
    """Residuals over the noise that they were weighted with."""
    if state.identified is None:
        return np.nan
    return float(np.sqrt(state.identified.result.chi2 / state.identified.result.dof))


def passes(states: list[RunState]) -> int:
    return sum(state.judged is not None and state.judged.verdict is Verdict.PASS for state in states)


def test_noisier_encoders_than_stated(tmp_path: Path, figure: Figures) -> None:
    states: dict[str, list[RunState]] = {}
    for name, how in (("measured", MEASURED), ("stated", STATED)):
        states[name] = []
        for seed in range(1, RUNS + 1):
            folder = tmp_path / f"{name}-{seed}"
            folder.mkdir()
            states[name].append(whole_run(folder, seed, how))
    for name, found in states.items():
        ratios = [ratio_of(state) for state in found]
        figure(f"residuals over {name} noise, median of {RUNS} runs", np.nanmedian(ratios))
    told = [state.noise for state in states["measured"] if state.noise is not None]
    sizes = [event.noise.encoders[0].record for event in told]
    figure(
        "noise of the encoders, 0.03 mm, as measured, median", np.median(sizes), "mm", between(0.02, 0.04)
    )
    least = at_least(RUNS // 2 + 1)
    figure("runs that pass with measured noise", passes(states["measured"]), f"of {RUNS}", least)
    figure("runs that pass with stated noise", passes(states["stated"]), f"of {RUNS}", NEVER)
