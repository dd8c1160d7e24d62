"""What a run is: commands, steps, events, and the state that is folded from them."""
