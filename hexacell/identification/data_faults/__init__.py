"""Faults in the data: outliers, zero shifts and misread gauges, found and named."""
