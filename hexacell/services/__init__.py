"""The application layer: runs, replays, the demo and the devices of a cell, put together."""
