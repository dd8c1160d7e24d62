"""Simulated dial indicators on a pseudo-terminal or a socket."""
