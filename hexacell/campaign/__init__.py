"""The measuring campaign: which point and pose next, when to stop, what accuracy to expect."""
