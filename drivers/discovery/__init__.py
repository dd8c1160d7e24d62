"""Finds devices whose addresses nobody knows: only questions are sent, and every wait is bounded."""
