"""What is not known of the robot's accuracy: uncertainty of the errors at the task poses."""
