"""The rules of the guards, one a file: functions of the latest answers that give a trip, or None."""
