"""Diagnostics of a solution: accuracy, correlations, tolerances, repeatability, noise levels."""
