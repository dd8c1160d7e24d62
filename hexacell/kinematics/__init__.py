"""Kinematics of six-legged parallel mechanisms: inverse, forward, sensitivity."""
