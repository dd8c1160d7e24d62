"""The calibration certificate of a run for programs: PTB's Digital Calibration Certificate, schema 3.3."""
