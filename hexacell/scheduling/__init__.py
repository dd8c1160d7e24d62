"""Runs without a person: when they begin, and what starts them."""
