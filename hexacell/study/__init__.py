"""Simulation studies: calibrations of robots whose geometry is known exactly."""
