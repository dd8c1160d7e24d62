"""The journal: all events of a run, on the disk."""
