"""The command line: parse, show, ask; no logic of its own."""
