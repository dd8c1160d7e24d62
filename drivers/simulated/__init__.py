"""A cell that answers on the wire, byte for byte, with nothing attached."""
