"""Recorded runs: whether a journal is sound, whose it is, and what it says of robot and commands."""
