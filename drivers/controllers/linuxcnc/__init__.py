"""Driver of LinuxCNC over its remote shell, linuxcncrsh."""
