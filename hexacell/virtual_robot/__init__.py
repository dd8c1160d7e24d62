"""Robots drawn within their tolerances, and how they move when commanded."""
