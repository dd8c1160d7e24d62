"""What is said in dialogues with LinuxCNC: exchanges in short, and those that many have in common."""

from __future__ import annotations

from hexacell.kinematics.pose import Pose


def said(text: str) -> list[tuple[str, bytes]]:
    """Exchanges, separated by ``|``: ``get estop: ON`` is answered by ESTOP ON, ``set mode mdi`` by ACK.

    ``set machine on: NAK`` is refused.
    """
    exchanges = []
    for exchange in text.split(" | "):
        asked, _, answer = exchange.partition(": ")
        verb, name = asked.split()[:2]
        if verb == "get":
            exchanges.append((asked, f"{name.upper()} {answer}\r\n".encode()))
        else:
            exchanges.append((asked, f"SET {name.upper()} {answer or 'ACK'}\n\r".encode()))
    return exchanges


TARGET = Pose(10.0, 20.0, 560.0, 5.0, -4.0, 3.0)
MOVE_S = 3.0
MDI = (
    "set mdi G21 G53 G93 G1 X10.00000000 Y20.00000000 Z560.00000000 A5.00000000 B-4.00000000 C3.00000000 "
    "F20.00000000"
)
ACK, NAK = b"SET MDI ACK\n\r", b"SET MDI NAK\n\r"
ARRIVED = b"ABS_ACT_POS 10.000000 20.000000 560.000000 5.000000 -4.000000 3.000000\r\n"
HALF_WAY = b"ABS_ACT_POS 5.000000 10.000000 555.000000 2.500000 -2.000000 1.500000\r\n"
MOVED = [(MDI, ACK), ("get abs_act_pos", ARRIVED)]
[RESTORED] = said("set mdi G94 G0")
[NO_ERROR] = said("get error: OK")
[AGAIN_IN_CONTROL] = said("set enable EMCTOO")
[ABORT] = said("set abort")
JOINTS = ("get joint_pos", b"JOINT_POS 1 2 3 4 5 6\r\n")
REFUSED = [(MDI, NAK), *said("get enable: ON")]
NO_ESTOP, IN_ESTOP = said("get estop: OFF"), said("get estop: ON")
IS_ON, IS_OFF = said("get machine: ON"), said("get machine: OFF")
HOMED = said("get joint_homed: YES YES YES YES YES YES")
NOT_HOMED = said("get joint_homed: NO YES NO NO NO NO")
OFF, READY = [*NO_ESTOP, *IS_OFF], [*NO_ESTOP, *IS_ON, *HOMED]
SWITCHING_ON = [*OFF, *said("set machine on"), *IS_ON]
ON_NOT_HOMED = [*NO_ESTOP, *IS_ON, *NOT_HOMED]
MDI_MODE = said("set mode mdi | get mode: MDI")
[UNITS, CODES, OFFSETS, OVERRIDE] = OWN_COORDINATES = said(
    "get user_linear_units: MM | get program_codes: G80 G17 G40 G21 G90 G94 G54 G49 G92.2 F0 S0 | "
    "get pos_offset: 0.000000 0.000000 -0.000000 0.000000 0.000000 0.000000 | get feed_override: 100"
)
TAKING_CONTROL = said(
    "set enable EMCTOO | get error: left over from somebody else | get error: OK | set set_wait done"
)
IN_JOINT_MODE = said("set mode manual | get teleop_enable: NO | get error: OK")
HOMING = [*said("set home -1"), *NOT_HOMED, *HOMED]
