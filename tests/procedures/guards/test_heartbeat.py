"""A controller whose server answers and which no longer works is told from one that works."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.interfaces import ControllerStatus, EncoderSample
from procedures.run.keys import Phase, SetKey
from procedures.run.trips import Guard, GuardTripped
from procedures.steps.move import Move

P1, V1 = SetKey(phase=Phase.IDENTIFY, point=1), SetKey(phase=Phase.BEFORE, point=1)
STALE_S = 0.12


def move(at: SetKey) -> Move:
    x, y, z = (100.0, -100.0, 500.0) if at is P1 else (-100.0, -50.0, 450.0)
    return Move(at=at, orientation=1, pose=(x, y, z, 0.0, 0.0, 0.0))


@pytest.fixture
def stage(scene: Any) -> Any:
    """A scene whose controller reports where its joints are, until ``frozen_at``, with a lag."""
    made = scene()
    made.frozen_at, made.lag_s, made.reported = float("inf"), 0.0, []

    async def status() -> ControllerStatus:
        await made.rig.clock.sleep(0.001)
        if made.now < made.frozen_at:
            made.reported.append((made.now, str(made.rig.machine.pose())))
        shown = [pose for then, pose in made.reported if then <= made.now - made.lag_s]
        return ControllerStatus(estop=False, enabled=True, heartbeat=(shown or ["home"])[-1])

    made.controller.status = status
    return made


async def test_a_controller_that_freezes_during_a_move_stops_the_robot(stage) -> None:
    await stage.do(move(P1))
    stage.frozen_at = stage.now + 0.3
    with pytest.raises(
        GuardTripped, match=r"is frozen: its server answers, .* although encoder"
    ) as tripped:
        await stage.do(move(V1))
    assert tripped.value.trip.guard is Guard.STALE
    assert stage.stops == 1
    assert stage.now - stage.frozen_at < 4 * STALE_S


@pytest.mark.parametrize("lag_s", [0.0, 0.02, 0.1])
async def test_a_controller_that_works_is_not_called_frozen_though_it_lags(stage, lag_s: float) -> None:
    stage.lag_s = lag_s
    for at in (P1, V1, P1):
        await stage.do(move(at))
    assert stage.stops == 0


async def test_encoders_that_lag_behind_the_controller_at_the_end_are_no_motion(stage) -> None:
    real = stage.rig.bench.encoders.read

    async def late() -> EncoderSample:
        sample: EncoderSample = await real()
        await stage.rig.clock.sleep(0.08)
        return sample

    stage.rig.bench.encoders.read = late
    for at in (P1, V1):
        await stage.do(move(at))
    assert stage.stops == 0
