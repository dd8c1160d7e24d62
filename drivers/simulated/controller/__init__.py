"""A controller that answers as LinuxCNC's linuxcncrsh does, in front of any machine."""
