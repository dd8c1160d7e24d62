"""Driver of the encoders: six CANopen nodes (CiA 406) on any CAN interface."""
