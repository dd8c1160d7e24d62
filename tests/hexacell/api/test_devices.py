"""What devices show, live: all of them, with what is wrong; nobody else has them meanwhile."""

import pytest

from hexacell import api
from hexacell.cell.loader import dump
from hexacell.errors import CellBusy, UsageError
from hexacell.runs.cell_lock import cell_lock
from tests.small_cell import changed


def test_each_device_is_read_and_nothing_moves(cell) -> None:
    with api.LiveDevices(cell) as devices:
        first = devices.read()
        shown = devices.read()
        with pytest.raises(CellBusy), cell_lock(cell.config_path):
            pass
    assert [gauge.name for gauge in shown.gauges] == ["x", "y", "z"]
    assert all(gauge.shown_mm is not None and abs(gauge.shown_mm) < 6.0 for gauge in shown.gauges)
    assert first.encoders.value is not None
    assert shown.encoders.value is not None
    assert shown.encoders.value.positions == pytest.approx(first.encoders.value.positions, abs=0.02)
    assert shown.controller.value is not None
    assert not shown.controller.value.enabled
    assert "encoders:" in devices._repr_html_()
    with pytest.raises(UsageError, match="over"):
        devices.read()
    with cell_lock(cell.config_path):
        pass


async def test_a_silent_one_says_so_also_on_a_loop_that_runs(cell) -> None:
    text = dump(
        changed(
            cell.settings,
            {
                "gauges": tuple(
                    gauge.model_copy(update={"timeout_s": 0.5}) for gauge in cell.settings.gauges
                )
            },
        )
    )
    cell.path.write_text(f'{text}\n[[simulation.faults]]\nkind = "silent"\ndevice = "y"\n')
    with api.LiveDevices(api.load_cell(cell.path)) as devices:
        shown = devices.read()
    assert [bool(gauge.problem) for gauge in shown.gauges] == [False, True, False]
    assert "gauge y" in shown.gauges[1].problem


def test_a_cell_in_use_is_busy(cell) -> None:
    with cell_lock(cell.config_path), pytest.raises(CellBusy):
        api.LiveDevices(cell)
