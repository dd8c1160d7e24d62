"""What every mechanism must do, as tests: for those that come with the package, and for others.

A package that adds a mechanism subclasses :class:`MechanismConformance` in its tests; pytest collects it.
"""

from hexacell.conformance.example import MechanismExample
from hexacell.conformance.suite import MechanismConformance

__all__ = ["MechanismConformance", "MechanismExample"]
