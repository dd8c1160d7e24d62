"""The site: its configuration, and what of it is made from the program."""
