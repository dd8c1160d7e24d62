"""A calibration of a simulated machine that becomes warm, with thermometers on its legs and its base."""

import json

import numpy as np
import pytest

from hexacell.cell.devices import ThermometerSettings
from hexacell.services.run.replay_run import replay
from procedures.replay.replayer import Scope
from procedures.steps import events

LEGS_SHARE = (1.0, 2.0, 1.5, 2.5, 1.0, 2.0)
LEGS = [ThermometerSettings(name=f"leg {leg}", path="simulated", legs=(leg,)) for leg in range(1, 7)]
BASE = ThermometerSettings(name="base", path="simulated", part="base")


@pytest.mark.slow
async def test_a_run_takes_the_expansion_of_its_legs_out_and_says_for_which_temperature(make_site) -> None:
    steel = {f"uncertainty__expansion_{part}_um_m_k": 11.5 for part in ("legs", "base", "platform")}
    # From the first second on, however long the run takes.
    warm = {"rise_k": 3.0, "over_s": 1.0, "legs_share": LEGS_SHARE}
    simulated = {f"simulation__temperature__{key}": value for key, value in warm.items()}
    site = make_site(thermometers=(*LEGS, BASE), model__temperature_c=20.0, **steel, **simulated)
    ended = await site.calibrate()
    assert ended.exit_code == 0
    taken = site.happened(events.RecordTaken)
    shown = np.array([one.reading.part_temperatures for one in taken])
    np.testing.assert_allclose(shown - 20.0, 3.0 * np.tile([*LEGS_SHARE, 1.0], (len(shown), 1)), atol=1e-3)
    [identified] = site.happened(events.Identified)
    assert identified.result.holds_at_c == (20.0,) * 7
    assert "geometry of legs at 20.0 deg C" in ended.line
    names = {one["name"] for one in json.loads(site.folder.result.read_text())["uncertainty"]["lines"]}
    assert {"thermometers of the legs", "coefficients of thermal expansion"} < names
    replayed = await replay(site.folder.path, Scope.RESULTS)
    assert replayed.differences == []
