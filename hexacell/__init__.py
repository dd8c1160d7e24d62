"""Make a 6-DOF parallel robot accurate with three dial gauges and a ball."""

__version__ = "0.1.0"
