"""Simulation studies: robots that are known exactly, and what a calibration makes of them."""
