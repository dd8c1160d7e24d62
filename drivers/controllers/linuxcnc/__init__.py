"""The linuxcncrsh protocol of LinuxCNC."""
