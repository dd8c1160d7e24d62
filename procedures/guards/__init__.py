"""Guards: what must hold before and during motion, and stops the robot otherwise."""
