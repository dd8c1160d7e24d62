"""The runs of a cell so far: results, comparison, drift, retention."""
