"""The results of runs as data, for the journal and for files."""
