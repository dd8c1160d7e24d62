"""Runs without a person: when they begin, what starts them, and when they end."""
