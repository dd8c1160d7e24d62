"""How to talk to gauges, encoders and controllers, real or simulated."""
