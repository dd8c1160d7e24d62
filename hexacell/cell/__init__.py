"""The cell file: one robot, its devices, its limits, and the plan."""
