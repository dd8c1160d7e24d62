"""What is done to the robot, in what order, and what is kept of it."""
