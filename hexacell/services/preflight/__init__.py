"""Before a run: warnings about the cell, and the exclusions in its file."""
