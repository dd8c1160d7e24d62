"""Which step comes next, one stage of a calibration a file; preflight."""
