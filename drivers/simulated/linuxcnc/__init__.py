"""A LinuxCNC that answers linuxcncrsh."""
