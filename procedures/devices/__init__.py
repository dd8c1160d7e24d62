"""The devices of a cell together: reading, settling, reconnecting."""
