"""What a LinuxCNC that is homed says, for tests that want one number of it."""

from drivers.interfaces import Controller
from hexacell.kinematics.pose import Pose


async def joints_of(driver: Controller) -> tuple[float, ...]:
    """The six joints as the controller has them, mm."""
    reported = await driver.position()
    assert reported is not None
    assert reported.joints is not None
    return reported.joints


async def pose_of(driver: Controller) -> Pose:
    """The actual pose by the controller's own kinematics, mm and deg."""
    reported = await driver.position()
    assert reported is not None
    return reported.pose
