"""Paths between poses: traced, checked against limits, planned over waypoints."""
