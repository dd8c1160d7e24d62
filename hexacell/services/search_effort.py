"""The effort of every search that this program makes."""

from hexacell.design.search_effort import USUAL_EFFORT, SearchEffort

EFFORT: SearchEffort = USUAL_EFFORT
"""Tests of whole runs replace it by a smaller one.

A run, its resumption and its replay decide alike only with the same effort, so it is no option.
"""
