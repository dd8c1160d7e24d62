"""Robot controllers, one protocol a family of files."""
