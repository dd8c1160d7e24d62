"""What a calibration is, and what its run has learnt so far."""
