"""Experiment design: candidate poses, predicted records, criteria, selection."""
