"""Each conformance test refuses a mechanism that breaks what it promises."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.conformance import MechanismConformance, MechanismExample
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import FrameFreedom, MechanismWords
from hexacell.kinematics.mechanisms.gough_stewart import (
    GOUGH_STEWART_PARAMETERS,
    THREE_LEGS_FRAME,
    GoughStewart,
)
from hexacell.kinematics.pose import PoseBatch
from tests.geometries import gough_stewart_geometry


def ring(radius: float, degrees: tuple[float, ...], height: float) -> np.ndarray:
    angles = np.radians(degrees)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(6, height)], axis=1)


DRAWING = gough_stewart_geometry(
    ring(350.0, (-50.0, 50.0, 70.0, 170.0, 190.0, 290.0), 0.0),
    ring(160.0, (-10.0, 10.0, 110.0, 130.0, 230.0, 250.0), -30.0),
    np.full(6, 500.0),
)
POINTS = np.array([(0, 0, 450), (60, 0, 430), (0, -60, 470), (-60, 60, 450), (40, 40, 500)], dtype=float)
TOLERANCES = {"base": 1.0, "platform": 1.0, "offset": 1.0}


def example(mechanism: GoughStewart) -> MechanismExample:
    return MechanismExample(mechanism, DRAWING, (), POINTS, TOLERANCES)


def suite(mechanism: GoughStewart) -> MechanismConformance:
    made = type("Suite", (MechanismConformance,), {"example": example(mechanism)})()
    assert isinstance(made, MechanismConformance)
    return made


def all_of(of: MechanismConformance) -> dict[str, Callable[[], None]]:
    return {name: getattr(of, name) for name in dir(of) if name.startswith("test_")}


class LegsOpen(GoughStewart):
    def inverse(self, geometry: Geometry, branch: Any, poses: PoseBatch) -> np.ndarray:
        return super().inverse(geometry, branch, poses) + 1e-6


class OtherBranch(GoughStewart):
    def branch(self, geometry: Geometry, poses: PoseBatch, joints: np.ndarray) -> np.ndarray:
        return -super().branch(geometry, poses, joints)


class InMetres(GoughStewart):
    def residual_and_jacobian(self, geometry, poses, joints):
        error, jacobian = super().residual_and_jacobian(geometry, poses, joints)
        return 1e-3 * error, 1e-3 * jacobian

    def derivatives(self, geometry, poses, joints):
        found = super().derivatives(geometry, poses, joints)
        return replace(
            found, pose=1e-3 * found.pose, joints=1e-3 * found.joints, parameters=1e-3 * found.parameters
        )


class WrongDerivative(GoughStewart):
    def derivatives(self, geometry, poses, joints):
        found = super().derivatives(geometry, poses, joints)
        return replace(found, parameters=found.parameters * np.array([1, 1, 1, 1, 1, -1, 1]))


class OneGeometry(GoughStewart):
    def residual_and_jacobian(self, geometry, poses, joints):
        if not isinstance(geometry, Geometry):
            geometry = Geometry(geometry.parameters, geometry.vector[0])
        return super().residual_and_jacobian(geometry, poses, joints)


class WrongRadius(GoughStewart):
    def platform_radius(self, geometry: Any) -> np.ndarray:
        return 2.0 * super().platform_radius(geometry)


class ZerosBackward(GoughStewart):
    def encoder_zeros(self, geometry: Geometry) -> np.ndarray:
        return -super().encoder_zeros(geometry)


class GuidesInWords(GoughStewart):
    words = MechanismWords("hexapod", joint="leg", guide="rail")


class RuleMissing(GoughStewart):
    convention = replace(THREE_LEGS_FRAME, zero=THREE_LEGS_FRAME.zero[:-1])


class RuleTooMany(GoughStewart):
    convention = replace(THREE_LEGS_FRAME, zero=(*THREE_LEGS_FRAME.zero, "offset6"))
    frame_freedom = FrameFreedom()

    def normalize_frames(self, geometry: Geometry):
        normal, change = super().normalize_frames(geometry)
        return self.convention.geometry(self.convention.free_parameters(normal)), change


class UnknownRule(GoughStewart):
    convention = replace(THREE_LEGS_FRAME, zero=(*THREE_LEGS_FRAME.zero[:-1], "base7x"))


class NearlyNormal(GoughStewart):
    def normalize_frames(self, geometry: Geometry):
        normal, change = super().normalize_frames(geometry)
        step = 1e-12 * np.eye(42)[GOUGH_STEWART_PARAMETERS.names.index("base1x")]
        return Geometry(normal.parameters, normal.vector + step), change


class NotTurned(GoughStewart):
    def change_frames(self, geometry: Geometry, change):
        changed = super().change_frames(geometry, change)
        return gough_stewart_geometry(changed["base"], geometry["platform"], changed["offset"])


BREAKS: dict[type[GoughStewart], str] = {
    LegsOpen: "test_the_inverse_closes_every_leg",
    OtherBranch: "test_the_inverse_closes_every_leg",
    InMetres: "test_constraints_are_lengths",
    WrongDerivative: "test_derivatives_are_those_of_the_constraints",
    OneGeometry: "test_batches_of_geometries",
    ZerosBackward: "test_encoder_zeros_are_changes_of_parameters",
    WrongRadius: "test_legs_in_space",
    GuidesInWords: "test_legs_in_space",
    RuleMissing: "test_the_rules_take_as_many_numbers_as_the_frames_are_free",
    UnknownRule: "test_the_rules_take_as_many_numbers_as_the_frames_are_free",
    RuleTooMany: "test_the_free_parameters_are_those_that_poses_determine",
    NearlyNormal: "test_the_convention_is_idempotent",
    NotTurned: "test_changes_of_frames_change_no_machine",
}


@pytest.mark.parametrize("broken", BREAKS, ids=lambda broken: broken.__name__)
def test_a_broken_mechanism_is_refused(broken: type[GoughStewart]) -> None:
    with pytest.raises(AssertionError):
        all_of(suite(broken()))[BREAKS[broken]]()


def test_wrong_derivatives_and_a_start_that_leads_nowhere_are_refused() -> None:
    with pytest.raises(AssertionError, match=r"off|not determined"):
        suite(WrongDerivative()).test_exact_records_are_identified()
    # Poses beyond a singularity of the robots that are built.
    far = replace(example(GoughStewart()), tolerances={"base": 400.0, "platform": 1.0, "offset": 1.0})
    made = type("Suite", (MechanismConformance,), {"example": far})()
    with pytest.raises(AssertionError, match=r"no pose within the tolerances|not equal"):
        made.test_forward_and_inverse_agree()


def test_all_that_a_sound_mechanism_must_do_is_tested() -> None:
    sound = all_of(suite(GoughStewart()))
    assert len(sound) == 12
    for test in sound.values():
        test()
