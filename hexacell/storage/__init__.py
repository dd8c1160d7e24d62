"""Atomic files, locks, and locations in TOML text."""
