"""Whether a robot has changed since it was identified, which leg, when and by how much."""
