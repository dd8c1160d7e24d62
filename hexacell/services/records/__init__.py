"""What a measurement file and a cell file say without a run: the geometry, the next pose."""
