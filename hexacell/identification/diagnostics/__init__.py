"""What follows from a result: pose accuracy, frames, tests of the model, tolerances."""
