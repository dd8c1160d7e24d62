"""LinuxCNC by its own Python module, on the computer that it runs on."""
