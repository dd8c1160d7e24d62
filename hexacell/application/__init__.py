"""Runs put together: cell, devices, procedure, identification, write-back."""
