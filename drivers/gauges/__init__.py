"""Drivers of dial indicators on serial lines, one protocol a file."""
