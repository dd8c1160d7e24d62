"""Temperatures of the legs from what thermometers showed, and where they showed nothing."""

from __future__ import annotations

import numpy as np

from hexacell.cell.devices import ThermometerSettings
from procedures.run.readings import (
    Reading,
    Temperature,
    legs_warmer,
    mean_leg_temperatures,
    mean_temperature,
)
from tests.procedures.story import READING

ROOM = ThermometerSettings(name="room", path="/room")
PAIR = ThermometerSettings(name="pair", path="/pair", legs=(1, 2))
SIXTH = ThermometerSettings(name="sixth", path="/sixth", legs=(6,))
ALL = (ROOM, PAIR, SIXTH)
BEFORE = (20.0, 21.0, None, None, None, 19.0)


def sample(**celsius: float | None) -> Reading:
    shown = tuple(Temperature(name=name, celsius=one) for name, one in celsius.items())
    return READING.model_copy(update={"temperatures": shown})


SHOWN = (sample(room=5.0, pair=22.0, sixth=20.0), sample(room=5.0, pair=24.0, sixth=None))


def test_each_leg_is_compared_with_its_own_temperature_of_before() -> None:
    expected = [[2.0, 1.0, 0.0, 0.0, 0.0, 1.0], [4.0, 3.0, 0.0, 0.0, 0.0, 1.0]]
    np.testing.assert_array_equal(legs_warmer(ALL, SHOWN, BEFORE), expected)


def test_what_is_not_known_is_not_taken_for_nothing() -> None:
    silent = [sample(room=5.0, pair=22.0, sixth=None)]
    assert np.isnan(legs_warmer(ALL, silent, BEFORE)[:, 5]).all()
    assert np.isnan(legs_warmer(ALL, SHOWN, ())[:, [0, 1, 5]]).all()
    assert not legs_warmer((ROOM,), SHOWN, ()).any()


def test_means_are_of_legs_that_have_a_thermometer() -> None:
    assert mean_leg_temperatures(ALL, SHOWN) == (23.0, 23.0, None, None, None, 20.0)
    assert mean_leg_temperatures(ALL, [sample(pair=None)]) == (None,) * 6
    assert mean_leg_temperatures(ALL, []) == (None,) * 6
    assert mean_temperature(SHOWN) == 15.2
    assert mean_temperature([sample(room=None)]) is None
