"""Checks of a calibrated robot: a short identification that decides, and the quick level."""
