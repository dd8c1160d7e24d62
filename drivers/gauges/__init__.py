"""Dial indicators on serial lines, one protocol a file."""
