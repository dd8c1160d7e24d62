"""The report of a run for people who file it: what it says, and how it is drawn."""
