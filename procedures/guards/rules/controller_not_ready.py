"""The controller is in emergency stop, off, or reports a following error."""

from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits
from procedures.run.trips import Guard, Trip


def controller_not_ready(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    report = devices.controller
    if report is None or report.value is None or report.value.may_move:
        return None
    status = report.value
    messages = "; ".join(status.error_messages)
    said = f": {messages}" if messages else ""
    if status.estop:
        action = "Find out why, release it and reset it at the controller, then resume"
        return Trip(Guard.EMERGENCY_STOP, report.device, f"is in emergency stop{said}", action)
    if "following error" in messages.lower():
        action = "Look for what blocks that leg, then switch on and resume"
        return Trip(Guard.FOLLOWING, report.device, f"switched itself off: {messages}", action)
    action = "Find out why, see to it, then resume"
    return Trip(Guard.CONTROLLER, report.device, f"was switched off{said}", action)
