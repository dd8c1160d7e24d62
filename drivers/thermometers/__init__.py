"""Thermometers, one protocol a file."""
