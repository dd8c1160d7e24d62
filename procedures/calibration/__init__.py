"""The calibration: every point zeroed, commanded and recorded, then identified and verified."""
