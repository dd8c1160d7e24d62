"""The controller's own config: formats, a proposed change, the change made, and the way back."""
