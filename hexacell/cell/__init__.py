"""The cell file: one robot, its devices, its limits, and what is asked of it."""
