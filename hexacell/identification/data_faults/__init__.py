"""Faults in the data: found by stepwise selection, named; begin with :mod:`.stepwise_selection`."""
