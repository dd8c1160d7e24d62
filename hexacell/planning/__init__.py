"""What to measure next, as one decision on the records so far: for ``run``, ``next`` and forecasts."""
