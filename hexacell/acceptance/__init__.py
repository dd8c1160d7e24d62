"""Acceptance of a result: gates before it is written, validation afterwards."""
