"""When to stop: what must hold at the start, before each move, and while the robot moves."""
