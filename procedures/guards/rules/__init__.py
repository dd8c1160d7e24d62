"""The rules of the guards, one a file. A line here is all that makes a function a rule."""

from procedures.guards.polling import PolledDevices
from procedures.guards.rules.ball_off_gauge import ball_off_gauge
from procedures.guards.rules.base import GuardLimits, Rule
from procedures.guards.rules.controller_frozen import controller_frozen
from procedures.guards.rules.controller_not_ready import controller_not_ready
from procedures.guards.rules.device_faults import device_faults
from procedures.guards.rules.device_silent import device_silent
from procedures.guards.rules.encoder_fault import encoder_fault
from procedures.guards.rules.gauge_at_end import gauge_at_end
from procedures.guards.rules.stop_requested import stop_requested
from procedures.guards.rules.unexpected_motion import unexpected_motion
from procedures.run.trips import Trip

RULES: tuple[Rule, ...] = (
    stop_requested,
    controller_not_ready,
    controller_frozen,
    encoder_fault,
    gauge_at_end,
    ball_off_gauge,
    unexpected_motion,
    device_faults,
    device_silent,
)
"""All that are evaluated continuously, in this order: a cause comes before its effects.

An emergency stop, for example, comes before the encoder that lost its supply with it.
"""


def first_trip(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
    """The first trip, in the order of ``RULES``."""
    return next((trip for rule in RULES if (trip := rule(devices, limits))), None)
