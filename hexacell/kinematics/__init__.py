"""Kinematics of six-legged parallel mechanisms: poses, geometry, inverse, forward, sensitivity."""
