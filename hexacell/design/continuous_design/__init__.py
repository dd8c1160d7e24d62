"""Continuous (approximate) designs: the most information that records could have, with a certificate."""
