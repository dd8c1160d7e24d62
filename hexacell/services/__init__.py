"""The application layer: runs, replays, the demo and the devices of a cell, put together."""

from hexacell.design.search_effort import USUAL_EFFORT, SearchEffort

EFFORT: SearchEffort = USUAL_EFFORT
"""Effort of every search that this program makes; tests of whole runs replace it by a smaller one.

A run, its resumption and its replay decide alike only with the same effort, so it is no option.
"""
