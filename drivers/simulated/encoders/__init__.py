"""Six CANopen encoders that answer on the wire, each sampled at the same SYNC."""
