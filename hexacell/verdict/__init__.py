"""The verdict on a robot: the decision rule, gates before a write-back, verification of a result."""
