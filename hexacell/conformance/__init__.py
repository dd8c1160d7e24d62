"""What every mechanism must do, as tests: for those that come with the package, and for others.

A package that adds a mechanism subclasses :class:`MechanismConformance` in its tests; pytest collects it.
"""

from hexacell.conformance.example import MechanismExample
from hexacell.conformance.frame_checks import FrameTests
from hexacell.conformance.kinematics_checks import KinematicsTests

__all__ = ["MechanismConformance", "MechanismExample"]


class MechanismConformance(KinematicsTests, FrameTests):
    """The tests of one mechanism.

    Subclass it in a test module, with an ``example``::

        class TestMine(MechanismConformance):
            example = MechanismExample(Mine(), drawing, branch=(), points=points, tolerances={"base": 1.0})

    Each test raises ``AssertionError`` with what does not agree.
    """
