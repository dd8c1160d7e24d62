"""How simulated devices are reached: pseudo-terminals, TCP, CAN over a line."""
