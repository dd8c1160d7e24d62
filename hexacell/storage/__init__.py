"""Files that survive a power cut, locks, and places in TOML text."""
