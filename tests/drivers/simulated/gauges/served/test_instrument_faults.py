"""Faults of the instrument: what it is set to, and where its plunger is."""

import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent, WrongSetting, ZeroVoid
from drivers.simulated.gauges.faults import InjectedGaugeFault
from tests.drivers.simulated.gauges.served.cell import PROTOCOLS, cell, served


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_inch(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.inject("y", InjectedGaugeFault.INCH)
        for call in (made.gauges["y"].read, made.gauges["y"].check, made.gauges["y"].open):
            with pytest.raises(WrongSetting, match="gauge y: answers in inch"):
                await call()
        assert (await made.gauges["z"].read()).value_mm == 3.0
        made.rack.clear("y", InjectedGaugeFault.INCH)
        await made.gauges["y"].open()
        assert (await made.gauges["y"].read()).value_mm == 2.0


@pytest.mark.parametrize("protocol", ["sylvac", "cdi"])
async def test_hold(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.inject("x", InjectedGaugeFault.HOLD)
        made.balls["x"] = 1.5
        assert (await made.gauges["x"].read()).value_mm == 1.0
        with pytest.raises(WrongSetting, match="gauge x: is on hold"):
            await made.gauges["x"].check()
        made.rack.clear("x", InjectedGaugeFault.HOLD)
        await made.gauges["x"].check()
        assert (await made.gauges["x"].read()).value_mm == 1.5


@pytest.mark.parametrize("protocol", ["sylvac", "cdi"])
async def test_reversed(protocol):
    async with cell([protocol] * 3) as made:
        await made.open()
        made.rack.inject("z", InjectedGaugeFault.REVERSED)
        assert (await made.gauges["z"].read()).value_mm == -3.0
        with pytest.raises(ZeroVoid, match="gauge z: was set differently: reversed False -> True"):
            await made.gauges["z"].check()
        made.rack.clear("z", InjectedGaugeFault.REVERSED)
        await made.gauges["z"].open()
        assert (await made.gauges["z"].read()).value_mm == 3.0


async def test_battery_low(sylvac):
    sylvac.rack.inject("x", InjectedGaugeFault.BATTERY_LOW)
    with pytest.raises(WrongSetting, match="gauge x: has a low battery"):
        await sylvac.gauges["x"].check()
    sylvac.rack.clear("x", InjectedGaugeFault.BATTERY_LOW)
    await sylvac.gauges["x"].check()


async def test_auto_off_and_on_again_voids_the_zero(sylvac):
    sylvac.rack.inject("x", InjectedGaugeFault.AUTO_OFF)
    with pytest.raises(GaugeSilent):
        await sylvac.gauges["x"].read()
    sylvac.rack.clear("x", InjectedGaugeFault.AUTO_OFF)
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


async def test_a_data_button_is_not_mistaken_for_an_answer():
    async with cell(["mux10"] * 3) as made:
        await made.open()
        made.rack.line("x").send_unsolicited(b"01A+0009.999\r")
        assert await made.values() == [1.0, 2.0, 3.0]


def test_faults_of_one_instrument_need_no_channel_one():
    with served("mux10", channels=(2, 3)) as line:
        line.inject(InjectedGaugeFault.INCH)
        assert line.device.indicators[2].inch
        line.inject(InjectedGaugeFault.INCH, channel=3)
        assert line.device.indicators[3].inch
        with pytest.raises(KeyError):
            line.inject(InjectedGaugeFault.INCH, channel=1)
        line.inject(InjectedGaugeFault.SILENT, answers=1)
