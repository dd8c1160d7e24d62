"""The calibration procedure: which step comes next, preflight, paths."""
