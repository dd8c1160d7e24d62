"""A stop line that is watched while the robot moves."""
