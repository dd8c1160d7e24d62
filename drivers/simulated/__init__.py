"""A simulated cell that answers on the wire as real devices do, byte for byte."""
