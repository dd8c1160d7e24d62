"""All devices together: failures are named at once, and a failure leaves no other device open."""

from __future__ import annotations

import asyncio

import pytest

from drivers.errors import GaugeAtEnd, GaugeSilent
from hexacell.errors import (
    CellBusy,
    DeviceError,
    ExitCode,
    HexacellError,
    SeveralErrors,
    consists_only_of,
)
from procedures.devices.device_set import gather_errors
from tests.waiting import until


async def test_all_devices_are_opened_and_identified(bench) -> None:
    identities = await bench.devices.open()
    names = [identity.name for identity in identities]
    assert names == ["x", "y", "z", *(f"encoder {leg}" for leg in range(1, 7)), "controller"]


async def test_all_devices_that_cannot_be_opened_are_named_at_once(bench) -> None:
    bench.gauges[1].dead = GaugeSilent("does not answer", subject="gauge y")
    bench.encoders.dead = DeviceError("node 3 is absent", subject="encoders")
    bench.controller.dead = DeviceError("refuses the connection", subject="controller")
    with pytest.raises(SeveralErrors) as refusal:
        await bench.devices.open()
    assert [error.subject for error in refusal.value.errors] == ["gauge y", "encoders", "controller"]
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert all(subject in str(refusal.value) for subject in ("gauge y", "encoders", "controller"))


async def test_the_others_are_closed_after_a_failure(bench, monkeypatch) -> None:
    async def broken() -> None:
        raise DeviceError("cannot be closed")

    monkeypatch.setattr(bench.gauges[0], "close", broken)
    monkeypatch.setattr(bench.encoders, "close", broken)
    await bench.devices.close()
    assert [bench.gauges[1].closed, bench.gauges[2].closed, bench.controller.closed] == [1, 1, 1]


async def answer(value: int | BaseException) -> int:
    await asyncio.sleep(0)
    if isinstance(value, BaseException):
        raise value
    return value


async def test_every_call_ends_before_an_error_is_raised() -> None:
    ended: list[int] = []

    async def slow() -> int:
        for _ in range(5):
            await asyncio.sleep(0)
        ended.append(1)
        return 1

    with pytest.raises(DeviceError):
        await gather_errors("no", [answer(DeviceError("broken")), slow()])
    assert ended == [1]


async def test_a_programming_error_is_not_hidden_behind_others() -> None:
    with pytest.raises(ZeroDivisionError):
        await gather_errors("no", [answer(DeviceError("broken")), answer(ZeroDivisionError())])


async def test_cancelling_cancels_every_call() -> None:
    begun: list[int] = []
    cancelled: list[int] = []

    async def forever(number: int) -> None:
        begun.append(number)
        try:
            await asyncio.Event().wait()
        finally:
            cancelled.append(number)

    task = asyncio.create_task(gather_errors("no", [forever(1), forever(2)]))
    await until(lambda: len(begun) == 2)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert cancelled == [1, 2]


END = GaugeAtEnd("is at an end")
SILENT = GaugeSilent("does not answer")


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (END, True),
        (SILENT, False),
        (SeveralErrors("two", [END, END]), True),
        (SeveralErrors("two", [END, SILENT]), False),
    ],
)
def test_errors_are_classified_by_their_kind(error: HexacellError, expected: bool) -> None:
    assert consists_only_of(error, GaugeAtEnd) is expected
    assert consists_only_of(error, GaugeAtEnd, CellBusy, GaugeSilent)
