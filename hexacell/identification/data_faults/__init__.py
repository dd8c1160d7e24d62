"""Faults in the data: outliers, zero shifts and gauge faults, found and named."""
