"""Runs without a person: when they begin, what starts them, when they end, and notices of all that."""
