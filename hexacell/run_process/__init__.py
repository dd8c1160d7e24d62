"""A run and those who watch it: messages, connections, and the process that the engine runs in."""
