"""Faults of the instrument: what it is set to, and where its plunger is."""

import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent, WrongSetting, ZeroVoid
from tests.drivers.simulated.gauges.served.cell import PROTOCOLS, cell, send_unsolicited


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_inch_is_refused_until_the_gauge_is_opened_in_mm(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.indicators["y"].inch = True
        for call in (made.gauges["y"].read, made.gauges["y"].check, made.gauges["y"].open):
            with pytest.raises(WrongSetting, match="gauge y: answers in inch"):
                await call()
        assert (await made.gauges["z"].read()).value_mm == 3.0
        made.rack.indicators["y"].inch = False
        await made.gauges["y"].open()
        assert (await made.gauges["y"].read()).value_mm == 2.0


@pytest.mark.parametrize("protocol", ["sylvac", "cdi"])
async def test_hold_is_found_by_the_check(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.indicators["x"].set_hold(on=True)
        made.balls["x"] = 1.5
        assert (await made.gauges["x"].read()).value_mm == 1.0
        with pytest.raises(WrongSetting, match="gauge x: is on hold"):
            await made.gauges["x"].check()
        made.rack.indicators["x"].set_hold(on=False)
        await made.gauges["x"].check()
        assert (await made.gauges["x"].read()).value_mm == 1.5


@pytest.mark.parametrize("protocol", ["sylvac", "cdi"])
async def test_a_reversed_direction_voids_the_zero(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.indicators["z"].reversed = True
        assert (await made.gauges["z"].read()).value_mm == -3.0
        with pytest.raises(ZeroVoid, match="gauge z: was set differently: reversed False -> True"):
            await made.gauges["z"].check()
        made.rack.indicators["z"].reversed = False
        await made.gauges["z"].open()
        assert (await made.gauges["z"].read()).value_mm == 3.0


async def test_a_low_battery_is_found_by_the_check(sylvac):
    sylvac.rack.indicators["x"].battery_low = True
    with pytest.raises(WrongSetting, match="gauge x: has a low battery"):
        await sylvac.gauges["x"].check()
    sylvac.rack.indicators["x"].battery_low = False
    await sylvac.gauges["x"].check()


async def test_auto_off_and_on_again_voids_the_zero(sylvac):
    sylvac.rack.indicators["x"].powered = False
    with pytest.raises(GaugeSilent):
        await sylvac.gauges["x"].read()
    sylvac.rack.line("x").switch_on()
    for call in (sylvac.gauges["x"].read, sylvac.gauges["x"].check):
        with pytest.raises(ZeroVoid, match=r"gauge x: was switched on again \(b'SY276\.1"):
            await call()
    await sylvac.gauges["x"].open()
    assert (await sylvac.gauges["x"].read()).value_mm == 0.0


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_plunger_at_its_end(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.balls["y"] = 6.3
        with pytest.raises(GaugeAtEnd, match="gauge y"):
            await made.gauges["y"].read()
        await made.gauges["y"].open()
        made.balls["y"] = 6.2
        assert (await made.gauges["y"].read()).value_mm == 6.2


async def test_the_frame_of_a_data_button_is_no_answer():
    async with cell(["mux10"] * 3) as made:
        await made.open()
        send_unsolicited(made.rack.line("x"), b"01A+0009.999\r")
        assert await made.values() == [1.0, 2.0, 3.0]
