"""A cell's devices as one: opened again, settled, brought back to their reference."""
