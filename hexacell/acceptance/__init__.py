"""Whether a result may be accepted: gates before, validation after it is written."""
