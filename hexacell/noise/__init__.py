"""Noise of instruments and robot, measured at standstill and by repeated visits."""
