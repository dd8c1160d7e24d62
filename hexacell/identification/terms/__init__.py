"""What is not geometry: play, backlash and compliance, identified beside it and chosen by evidence."""
