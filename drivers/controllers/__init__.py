"""Drivers of robot controllers, one package a protocol."""
