"""What the technician's screens show: views of a run, a cell and its history, made from typed data."""
