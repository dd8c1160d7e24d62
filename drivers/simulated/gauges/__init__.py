"""Simulated dial indicators that answer byte for byte on a pseudo-terminal or a socket."""
