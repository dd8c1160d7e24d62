"""Thermometers that are read from a file: valid and invalid contents."""

import os
import threading
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from unittest.mock import Mock

import pytest

from drivers import thermometers
from drivers.interfaces import TemperatureReading
from drivers.thermometers import OTHER, RIGHTS, SLOW, SysfsThermometer
from hexacell.cell.devices import ThermometerSettings
from hexacell.errors import DeviceError

SENSOR = "Check the sensor behind"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "temperature"


def show(path: Path, text: str) -> None:
    path.write_text(text, encoding="latin-1")


@pytest.fixture
def timeout_s() -> float:
    return 2.0


@pytest.fixture
async def room(path: Path, timeout_s: float) -> AsyncIterator[SysfsThermometer]:
    made = SysfsThermometer(ThermometerSettings(name="room", path=str(path), timeout_s=timeout_s))
    yield made
    await made.close()
    await made.close()


@pytest.mark.parametrize(
    ("text", "celsius"), [("21375\n", 21.375), ("-500\n", -0.5), ("0", 0.0), ("85125\n", 85.125)]
)
async def test_millidegrees_are_read(path, room, text, celsius):
    show(path, text)
    assert await room.read() == TemperatureReading(celsius, text.strip())


@pytest.mark.parametrize(
    ("text", "words", "check"),
    [
        ("", "gives no number but ''", SLOW),  # a 1-wire sensor that is still measuring
        ("NO\n", "gives no number but 'NO'", OTHER),
        ("21.5\n", "gives no number but '21.5'", OTHER),
        ("\xff\xfe", "gives no number", OTHER),
        ("85000\n", "gives 85 deg C, as it does unmeasured", "Check the supply and cable of"),
        ("-127000\n", "gives -127 deg C, which is implausible", SENSOR),
        ("-2147483648\n", "gives -2.14748e[+]06 deg C", SENSOR),
        ("9" * 5000, "gives 1e[+]61 deg C|gives no number", SENSOR),
    ],
)
async def test_contents_that_are_no_temperature_are_refused(path, room, text, words, check):
    show(path, text)
    with pytest.raises(DeviceError, match=f"^thermometer room: {words}") as refusal:
        await room.read()
    assert refusal.value.action == f"{check} {path}"


async def test_other_thermometers_than_1_wire_may_show_85_degrees(path):
    hot = SysfsThermometer(ThermometerSettings(name="hot", path=str(path.with_name("temp1_input"))))
    show(path.with_name("temp1_input"), "85000")
    assert (await hot.read()).celsius == 85.0
    await hot.close()


async def test_an_unreadable_file_is_an_error_until_it_can_be_read(path, room):
    with pytest.raises(DeviceError, match="cannot be read: it does not exist"):
        await room.open()
    show(path, "20000")
    assert (await room.read()).celsius == 20.0


@pytest.mark.parametrize(("number", "told"), [(13, RIGHTS), (5, "Connect it, or correct path")])
async def test_why_a_file_cannot_be_read_decides_the_advice(path, room, monkeypatch, number, told):
    monkeypatch.setattr(os, "open", Mock(side_effect=OSError(number, "")))
    with pytest.raises(DeviceError, match=f"{told} {path}"):
        await room.read()


@pytest.mark.parametrize(
    ("make", "words"), [(Path.mkdir, "cannot be read: it is a folder"), (os.mkfifo, "gives no number")]
)
async def test_a_folder_or_a_pipe_is_no_thermometer(path, room, make, words):
    make(path)
    with pytest.raises(DeviceError, match=words):
        await room.read()


@pytest.mark.parametrize("timeout_s", [0.5])
async def test_a_sensor_that_blocks_is_not_read_again(path, room, monkeypatch):
    """At most one read blocks at a time, and its late result is discarded."""
    answers = threading.Event()
    content: Callable[[Path], str] = thermometers._content

    def slow(_: Path) -> str:
        answers.wait()
        return "99000"

    monkeypatch.setattr(thermometers, "_content", slow)
    show(path, "20000")
    with pytest.raises(DeviceError, match=r"does not answer within 0\.5 s"):
        await room.read()
    with pytest.raises(DeviceError, match="still does not answer"):
        await room.read()
    monkeypatch.setattr(thermometers, "_content", content)
    hanging = room._reading
    assert hanging is not None
    answers.set()
    hanging.result()
    assert (await room.read()).celsius == 20.0
