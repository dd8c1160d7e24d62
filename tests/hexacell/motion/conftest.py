"""What is known of a robot, as in the tests of the pose choice."""

from tests.hexacell.design.conftest import know, limits, little, much

__all__ = ["know", "limits", "little", "much"]
