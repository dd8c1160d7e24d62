"""Replay: a recorded run decided and computed again, and compared."""
