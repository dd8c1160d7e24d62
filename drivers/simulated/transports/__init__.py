"""Transports of simulated devices: pseudo-terminals, TCP, CAN over a serial line."""
