"""A simulated LinuxCNC that answers linuxcncrsh."""
