"""A controller that is a PLC: a client of its OPC UA server (docs/controller-opcua.md)."""
