"""What is said of one move, and what the controller answers."""

from __future__ import annotations

from hexacell.kinematics.pose import Pose

TARGET = Pose(10.0, 20.0, 560.0, 5.0, -4.0, 3.0)
MOVE_S = 3.0
MDI = (
    "set mdi G21 G53 G93 G1 X10.00000000 Y20.00000000 Z560.00000000 A5.00000000 B-4.00000000 C3.00000000 "
    "F20.00000000"
)
ACK = b"SET MDI ACK\n\r"
ARRIVED = b"ABS_ACT_POS 10.000000 20.000000 560.000000 5.000000 -4.000000 3.000000\r\n"
HALF_WAY = b"ABS_ACT_POS 5.000000 10.000000 555.000000 2.500000 -2.000000 1.500000\r\n"
RESTORED = ("set mdi G94 G0", ACK)
NO_ERROR = ("get error", b"ERROR OK\r\n")
AGAIN_IN_CONTROL = ("set enable EMCTOO", b"SET ENABLE ACK\n\r")
