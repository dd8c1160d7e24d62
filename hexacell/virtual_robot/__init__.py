"""Virtual robots: geometries drawn within the tolerances, and how they move when commanded."""
