"""Drivers of thermometers, one protocol a file."""
