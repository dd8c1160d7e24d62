"""The arguments of the commands, by what these are for. Only the standard library is imported."""
