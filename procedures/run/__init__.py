"""What a run is: steps, events, commands, questions, and the state folded from the events."""
