"""A recorded run through the real procedure: devices that answer what the journal says they did."""
