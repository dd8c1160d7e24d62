"""Limits in a LinuxCNC INI file."""

from pathlib import Path

import pytest

from hexacell.cell.fields import LARGEST_NUMBER
from hexacell.config.interface import ControllerLimits
from hexacell.config.linuxcnc_ini import limits_of_ini
from hexacell.errors import FileError

CONFIGS = Path(__file__).parents[3] / "configs"


def test_those_of_the_hexaglide_that_comes_with_it() -> None:
    found = limits_of_ini(CONFIGS / "linuxcnc-hexaglide" / "hexaglide.ini")
    assert found.joints == ((-800.0, 200.0),) * 3 + ((-200.0, 800.0),) * 3
    assert found.axes is not None
    assert found.axes == (*((-300.0, 300.0),) * 2, (350.0, 750.0), *((-45.0, 45.0),) * 3)


@pytest.fixture
def ini(tmp_path: Path):
    def write(*lines: str) -> Path:
        path = tmp_path / "machine.ini"
        path.write_text("\n".join(lines))
        return path

    return write


def test_an_inch_machine_has_angles_in_degrees_too(ini) -> None:
    path = ini(
        "[AXIS_X]", "MIN_LIMIT = -2", "MAX_LIMIT = 3", "[AXIS_B]", "MIN_LIMIT = -45", "MAX_LIMIT = 45"
    )
    found = limits_of_ini(path, 25.4)
    assert found.axes is not None
    assert found.axes[0] == pytest.approx((-50.8, 76.2))
    assert found.axes[1:] == (None, None, None, (-45.0, 45.0), None)


@pytest.mark.parametrize(
    ("kind", "limits"),
    [("TYPE = LINEAR", (-50.8, 76.2)), ("TYPE = ANGULAR", (-2.0, 3.0)), ("FERROR = 1", (-50.8, 76.2))],
)
def test_joints_that_turn_have_limits_in_degrees(ini, kind, limits) -> None:
    each = [(f"[JOINT_{leg}]", kind, "MIN_LIMIT = -2", "MAX_LIMIT = 3") for leg in range(6)]
    found = limits_of_ini(ini(*(line for lines in each for line in lines)), 25.4)
    assert found.joints is not None
    assert found.joints == tuple(pytest.approx(limits) for _ in range(6))


def test_a_limit_that_is_not_there_is_none(ini) -> None:
    found = limits_of_ini(ini("[AXIS_Z]", "MAX_LIMIT = 700", "[JOINT_0]", "MIN_LIMIT = 1"))
    assert found == ControllerLimits(axes=(None, None, (-LARGEST_NUMBER, 700.0), None, None, None))
    assert limits_of_ini(ini("[EMC]")) == ControllerLimits()


@pytest.mark.parametrize(
    ("lines", "problem", "line"),
    [
        (("[AXIS_A]", "MIN_LIMIT = 5", "MAX_LIMIT = -5"), r"MAX_LIMIT of \[AXIS_A\] is not above", 3),
        (("[AXIS_A]", "MIN_LIMIT = much"), "'much' is not a number", 2),
        (("[AXIS_A]", "MIN_LIMIT = -5 # deg"), "behind MIN_LIMIT stands '# deg'", 2),
        (("[AXIS_A]", "MIN_LIMIT = -5", "MIN_LIMIT = -4"), "a second time", 3),
    ],
)
def test_what_linuxcnc_would_read_otherwise_is_refused_with_its_line(ini, lines, problem, line) -> None:
    with pytest.raises(FileError, match=problem) as caught:
        limits_of_ini(ini(*lines))
    assert caught.value.line == line


def test_the_narrowest_of_two_limits_hold() -> None:
    one = ControllerLimits(
        joints=((-1.0, 5.0),) * 6, axes=((-9.0, 9.0), None, (1.0, 2.0), None, None, None)
    )
    two = ControllerLimits(
        joints=((-3.0, 3.0),) * 6, axes=((-5.0, 20.0), (0.0, 4.0), None, None, None, None)
    )
    both = ControllerLimits(
        joints=((-1.0, 3.0),) * 6, axes=((-5.0, 9.0), (0.0, 4.0), (1.0, 2.0), None, None, None)
    )
    assert one.narrowed(two) == two.narrowed(one) == both
    assert one.narrowed(ControllerLimits()) == ControllerLimits().narrowed(one) == one
