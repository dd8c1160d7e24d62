"""Encoders that only the controller can read."""

import pytest

from drivers.encoders.bank import joint_variables
from drivers.encoders.of_controller import ControllerScales
from drivers.errors import NotHomedError
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.errors import UsageError

JOINTS = (-461.827519, -455.741652, -448.908104, 465.952312, 465.044723, 488.923462)


class Controller:
    """Tells its joints, or that they are not homed."""

    joints: tuple[float, ...] | None = JOINTS

    async def joints_now(self) -> tuple[float, ...] | None:
        return self.joints


def settings(**changes: object) -> LinearEncoderSettings:
    return LinearEncoderSettings.model_validate(
        {"protocol": "controller", "measuring_step_nm": 1} | changes
    )


async def test_positions_are_what_the_controller_tells_in_the_cell_files_direction_and_offset() -> None:
    own = settings()
    bank = ControllerScales(own, Controller())
    assert [one.name for one in await bank.open()] == [f"encoder of leg {leg}" for leg in range(1, 7)]
    sample = await bank.read()
    assert sample.positions == pytest.approx(JOINTS, abs=5e-7)
    assert joint_variables(sample.counts, own) == sample.positions, "as a replay computes them"
    await bank.close()
    own = settings(direction=(1, -1, 1, 1, 1, 1), offset_mm=(0, 0, 0, 0, 0, 10), measuring_step_nm=1000)
    sample = await ControllerScales(own, Controller()).read()
    assert sample.counts[1] == 455742
    assert sample.counts[5] == 478923
    assert sample.positions == pytest.approx(JOINTS, abs=5e-4)


async def test_joints_that_include_zeros_are_told_less_the_present_ones() -> None:
    zeros = [600.0, 601.0, 602.0, 603.0, 604.0, 605.0]
    bank = ControllerScales(settings(), Controller(), lambda: zeros)
    told = (await bank.read()).positions
    assert told == pytest.approx(
        [joint - zero for joint, zero in zip(JOINTS, zeros, strict=True)], abs=5e-7
    )
    zeros[2] += 0.125
    assert (await bank.read()).positions[2] == pytest.approx(told[2] - 0.125, abs=1e-6)


async def test_joints_that_are_not_homed_are_no_positions() -> None:
    controller = Controller()
    controller.joints = None
    with pytest.raises(NotHomedError, match="are not homed"):
        await ControllerScales(settings(), controller).read()


def test_a_controller_that_does_not_tell_its_joints_is_refused() -> None:
    with pytest.raises(UsageError, match="does not report where its joints are"):
        ControllerScales(settings(), object())
