"""The command line: parses arguments, prints and reads keys."""
