"""From records to a geometry: the problem, the solver, what it found and how sure it is."""
