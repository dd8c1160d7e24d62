"""Gross errors, zero shifts and misread gauges: found, named, left out."""
