"""The stop input: a contact or a file that forbids motion."""
