"""What drives a run: takes commands, executes steps, appends events, recovers from failures."""
