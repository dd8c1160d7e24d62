"""Slider encoders: six CANopen nodes after CiA 406 behind any CAN interface."""
