"""Notices of runs that nobody watched: kept on the disk until who is to be told has them."""
