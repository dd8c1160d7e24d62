"""What is done to the robot: runs, the engine that drives them, guards, journal, replay."""
