"""Orders to a LinuxCNC of which a test wants a single query over the connection for commands."""

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from hexacell.kinematics.pose import Pose


async def joints_of(driver: LinuxcncrshController) -> tuple[float, ...]:
    """The six joints as the controller has them, mm."""
    async with driver._order:
        return await (await driver._session.synchronized()).joints()


async def pose_of(driver: LinuxcncrshController) -> Pose:
    """The actual pose by the controller's own kinematics, mm and deg."""
    async with driver._order:
        return await (await driver._session.synchronized()).pose()
